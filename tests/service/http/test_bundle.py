"""The modules of the page's start as one file; the browser tests run what comes of those of the page."""

import pytest

from hybridmpm_service.http.bundle import bundled, imported

SOURCES = {
    "main.js": """import { twice as double } from "./a/twice.js";
import * as b from "./b.js";
export const here = double(b.ONE);
const later = () => import("./late/x.js");
""",
    "a/twice.js": """import {
  ONE,
} from "../b.js";
// import nothing
export function twice(x) {
  return 2 * x * ONE;
}
export const address = import.meta.url;
new Worker(new URL("./work.js", import.meta.url));
""",
    "b.js": "export const ONE = 1;\n",
    "late/x.js": """import { twice } from "../a/twice.js";
import { y } from "./y.js";
export const z = twice(y);
""",
    "late/y.js": "export const y = 3;\n",
    "a/work.js": 'import { ONE } from "../b.js";\npostMessage(ONE);\n',
}


def test_the_modules_of_the_start_are_one_file() -> None:
    changed = bundled(SOURCES, "main.js")
    assert imported(SOURCES, ["main.js"]) == ["b.js", "a/twice.js", "main.js"]
    assert set(changed) == {"main.js", "late/x.js", "late/y.js"}
    b, twice, main = changed["main.js"].split("\n})();\n")[:3]
    assert b == "const $b = (() => {\nconst ONE = 1;\nreturn { ONE };"
    assert twice.startswith(
        "const $a_twice = (() => {\nconst {\n  ONE,\n} = $b;\n// import nothing\nfunction twice(x)"
    )
    assert 'const address = new URL("./a/twice.js", import.meta.url).href;' in twice
    assert "const { twice: double } = $a_twice;\nconst b = $b;\n" in main
    assert 'import("./late/x.js")' in main
    assert changed["main.js"].endswith("export { $b, $a_twice, $main };\n")
    assert changed["late/x.js"].startswith(
        'import { $a_twice } from "../main.js"; const { twice } = $a_twice;\nimport { y } from "./y.js";\n'
    )
    assert changed["late/y.js"] == SOURCES["late/y.js"]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("export default 1;", "b.js: cannot be part of one file: export default 1;"),
        ("export let count = 0;", "export let count"),
        ('export { x } from "./c.js";', "export { x }"),
        ("import './c.js';", "import './c.js'"),
        ('import { c } from "./c.js";', "there is no module c.js"),
        ('import("./main.js");', "b.js: main.js is loaded at the start, not on demand"),
    ],
)
def test_other_forms_are_refused(line: str, message: str) -> None:
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        bundled(SOURCES | {"b.js": f"{SOURCES['b.js']}{line}\n"}, "main.js")
