"""Methods of finding the law that follows a sketch; `choice.METHODS` lists them by name."""
