"""What a scene, a camera or a folder may be called by somebody who means harm."""

from __future__ import annotations

import re

# What becomes a link without brackets in GitHub's Markdown. Some readers, the second version of
# Prefect's pages among them, look for it in the text that is left when escapes are resolved.
ADDRESS = re.compile(r"(https?|ftp)://|www\.[-.\w]|[-.+\w]+@[-\w]+\.[-\w]", re.IGNORECASE)

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
    "![x](&#47;&#47;somewhere&#47;seen.png)",
    "www.somewhere.example",
    "WWW.somewhere.example/a",
    "http://somewhere.example",
    "ftp://somewhere.example",
    "somebody@somewhere.example",
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
