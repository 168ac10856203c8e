"""Where learning pays: networks against the cheapest MPM of equal error, over resolution and stiffness."""
