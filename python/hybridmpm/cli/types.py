"""Types of command-line options that several commands share."""

import click


class RatioType(click.ParamType[float, object]):
    """A number, or the ratio of two numbers: 0.25 or 1/1.75."""

    name = "number or a/b"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number; fails for other text and for a ratio with 0 below."""
        above, slash, below = str(value).partition("/")
        try:
            return float(above) / float(below) if slash else float(above)
        except (ValueError, ZeroDivisionError):
            self.fail(f"{value!r} is no number such as 0.25 or 1/1.75", param, ctx)
