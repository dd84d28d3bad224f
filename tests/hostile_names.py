"""What a scene, a camera or a folder may be called by somebody who means harm."""

from __future__ import annotations

HOSTILE = [
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "' onmouseover='alert(1)",
    "</title></style></script><script>alert(1)</script>",
    "--><!--",
    "a|b||c",
    "`code`",
    "``` ``x``",
    "[here](javascript:alert(1))",
    "](javascript:alert(1))",
    "![seen](https://somewhere/seen.png)",
    "<https://somewhere>",
    "two\nlines\n\n# of a heading",
    "| a |\n|-|\n| b |",
    "\\",
    "\\|",
    "&lt;b&gt;",
    "**loud** ~~gone~~",
    "$x^{$ $\\frac{1}$",
    "{{ 7 * 7 }}{% raw %}",
    "[bold]rich[/] [/]",
]
