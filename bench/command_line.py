"""Shared parts of the benchmarks' command lines: numbers that are finite and in their range, names that cannot be
taken for options, and pictures by gnuplot."""

import argparse
import math
import os
import subprocess
from pathlib import Path


def number(low, high):
    """For argparse: a finite number in the range."""

    def parse(text):
        value = float(text)
        if not (math.isfinite(value) and low <= value <= high):
            raise argparse.ArgumentTypeError(f"{text!r} is not a number from {low:g} to {high:g}")
        return value

    parse.__name__ = "number"
    return parse


def whole(low, high):
    """For argparse: a whole number in the range, always decimal, even with a leading zero."""

    def parse(text):
        value = int(text, 10)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {low} to {high}")
        return value

    parse.__name__ = "whole number"
    return parse


def file_name(text):
    """For argparse: an absolute path, which no program takes for an option or a command."""
    return Path(os.path.abspath(text))


def refuse_overwriting(parser, inputs, outputs):
    """Wrong usage if an output is an input or another output, also under another name."""
    outputs = [path for path in outputs if path is not None]
    for i, output in enumerate(outputs):
        for other in [*inputs, *outputs[:i]]:
            if os.path.realpath(other) == os.path.realpath(output) or (output.is_file() and other.exists() and output.samefile(other)):
                parser.error(f"{output} would be overwritten: it is {other} too; choose another name")


def draw(script, path):
    """The script must set a terminal and no output: gnuplot would run a name that begins with a bar as a command."""
    picture = subprocess.run(["gnuplot", "--default-settings", "-"], input=script.encode(), stdout=subprocess.PIPE, check=True).stdout
    Path(path).write_bytes(picture)
