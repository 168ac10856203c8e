"""How many messages a client may send: so many a second, with bursts."""

from hybridmpm_service.sessions.playing.pace import Clock


class Throttle:
    """A bucket that fills with `rate` tokens a second up to `burst`; a message takes one for each KiB begun.

    Parameters
    ----------
    rate : float > 0
        Small messages a second [1/s].
    burst : int >= 1
        Small messages at once after a pause.
    clock : Clock
    """

    def __init__(self, rate: float, burst: int, clock: Clock) -> None:
        self._rate, self._burst, self._clock = rate, burst, clock
        self._tokens = float(burst)
        self._latest = clock()

    def admits(self, size: int) -> bool:
        """Take the tokens of a message of so many bytes; return False where too few are left."""
        tokens = 1 + size // 1024
        now = self._clock()
        self._tokens = min(self._burst, self._tokens + (now - self._latest) * self._rate)
        self._latest = now
        if self._tokens < tokens:
            return False
        self._tokens -= tokens
        return True
