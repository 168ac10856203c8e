"""Networks that control a fluid: which acceleration makes it follow a sketch."""
