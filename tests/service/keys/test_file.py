"""The file of keys, and the command that makes keys."""

import re
from pathlib import Path

import pytest

from hybridmpm.errors import ConfigError
from hybridmpm_service.keys.command import main
from hybridmpm_service.keys.file import add, hashed, read

SECRET = f"secret {'5f' * 32}\n"
HASH = f"sha256:{'9c' * 32}"


def written(folder: Path, text: str | bytes) -> Path:
    """Return a file of keys with a content."""
    path = folder / "keys"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    path.chmod(0o600)
    return path


def test_a_key_is_added_and_its_token_is_in_no_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "keys"
    assert main(["anna", "--file", str(path), "--sessions", "4", "--load", "1.5"], "hybridmpm key") == 0
    token = capsys.readouterr().out.strip()
    assert re.fullmatch(r"hmpm_anna_[\w-]{43}", token)
    assert main(["screen", "--file", str(path), "--scopes", "view", "--of", "anna"], "hybridmpm key") == 0
    assert path.stat().st_mode & 0o777 == 0o600
    assert token not in path.read_text("utf-8")
    keys = read(path).keys
    assert keys["anna"].hashed == hashed(token)
    assert keys["anna"].scopes == {"view", "steer", "create"}
    assert (keys["anna"].quota.sessions, keys["anna"].quota.load, keys["anna"].quota.jobs) == (4, 1.5, None)
    assert (keys["screen"].owner, keys["screen"].scopes) == ("anna", {"view"})


def test_a_key_goes_on_a_line_of_its_own(tmp_path: Path) -> None:
    path = written(tmp_path, f"{SECRET}# ours\r\n\r\nkey a view {HASH} jobs=0 # the first")
    add(path, "b", "view")
    assert list(read(path).keys) == ["a", "b"]
    assert read(path).keys["a"].quota.jobs == 0


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["anna"], "has a key 'anna'|there is a key 'anna'"),
        (["Anna"], "small letters, digits and dashes, not 'Anna'"),
        (["a_b"], "small letters"),
        (["b", "--scopes", "view,fly"], "scopes are some of view,steer,create,admin"),
        (["b", "--of", "c"], "no key of its own"),
        (["b", "--sessions", "-1"], "sessions is a number from 0 on, not '-1'"),
        (["b", "--load", "nan"], "load is a number"),
        (["b", "--of", "anna", "--jobs", "1"], "quotas stand with the key 'anna'"),
    ],
)
def test_a_wrong_command_is_one_line_and_changes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    path = tmp_path / "keys"
    add(path, "anna", "view")
    before = path.read_bytes()
    assert main([*arguments, "--file", str(path)], "hybridmpm key") == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert re.search(text, told.err)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{SECRET}key a view\n", "line 2 of .*: a line is `secret DIGITS` or `key NAME"),
        (f"{SECRET}\n\nkey a look {HASH}", "line 4 of .*: scopes are some of"),
        (f"{SECRET}key a view,view {HASH}", "line 2 of .*: scopes"),
        (f"{SECRET}key a view sha256:{'9C' * 32}", "line 2 of .*: the hash of a token is"),
        (f"{SECRET}key a view {HASH} sessions=4 sessions=5", "line 2 of .*: 'sessions=5' is none of"),
        (f"{SECRET}key a view {HASH} weight=4", "'weight=4' is none of of=NAME, sessions=NUMBER"),
        (f"{SECRET}key a view {HASH}\nkey a view {HASH}", "line 3 of .*: there is a key 'a' above"),
        (f"{SECRET}key a view {HASH} of=b", "'a' is of 'b', which is no key"),
        (f"{SECRET}key a view {HASH} of=b\nkey b view {HASH} of=a", "no key of its own"),
        (f"{SECRET}{SECRET}", "line 2 of .*: there is one secret"),
        ("secret 12", "line 1 of .*: there is one secret, of 64"),
        (f"key a view {HASH}", "has no line `secret`"),
        ("", "has no line `secret`"),
        (SECRET.encode() + b"key \xff view", "line 2 of .*: it is not UTF-8"),
        (SECRET.encode() + bytes(100), "line 2 of"),
        (b"#" * (1 << 20) + b"\n", "is larger than"),
    ],
)
def test_a_damaged_file_is_refused_with_its_line(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read(written(tmp_path, text))


@pytest.mark.parametrize("mode", [0o644, 0o604, 0o660, 0o602])
def test_a_file_that_others_may_read_or_change_is_refused(tmp_path: Path, mode: int) -> None:
    path = written(tmp_path, SECRET)
    path.chmod(mode)
    with pytest.raises(ConfigError, match=rf"has the mode 0{mode:o}.*chmod 600"):
        read(path)


def test_a_group_may_read_it_and_a_missing_file_says_how_to_make_it(tmp_path: Path) -> None:
    path = written(tmp_path, SECRET)
    path.chmod(0o640)
    assert read(path).keys == {}
    with pytest.raises(ConfigError, match=r"cannot be read .*hybridmpm key NAME --file"):
        read(tmp_path / "none")
