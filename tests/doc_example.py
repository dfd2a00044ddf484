#!/usr/bin/env python3
"""Compiles the C program in a page of docs/ and runs it: doc_example.py PAGE.md CC LIBRARY.a INCLUDE OUT ARGUMENT...

The page's first ```c block must compile without a warning and exit with 0; what it prints is checked for not being empty."""

import os
import re
import subprocess
import sys

page, compiler, library, include, out, *arguments = sys.argv[1:]
with open(page, encoding="utf-8") as file:
    program = re.search(r"^```c\n(.*?)^```$", file.read(), re.MULTILINE | re.DOTALL)
if not program:
    sys.exit("%s: no C program" % page)
os.makedirs(os.path.dirname(out), exist_ok=True)
with open(out + ".c", "w", encoding="utf-8") as file:
    file.write(program.group(1))
subprocess.run([compiler, "-std=c11", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-I", include, out + ".c", library, "-lm", "-o", out], check=True)
text = subprocess.run([out] + arguments, check=True, capture_output=True, text=True).stdout
print(text, end="")
if not text.strip():
    sys.exit("%s: the program prints nothing" % page)
