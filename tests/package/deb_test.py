#!/usr/bin/python3
"""Checks the Debian package with dpkg-deb and lintian. tests/systemd checks its installation, upgrade and removal under a
real systemd."""

import os
import platform
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ.get("VGYRO_SOURCE", Path(__file__).resolve().parents[2]))
FOLDER = SOURCE / "build/package"

EXPECTED = """\
/etc/default/vgyrod
/etc/vgyro/vgyro.toml
/lib/systemd/system/vgyrod.service
/lib/systemd/system/vgyrod@.service
/usr/bin/vgyro
/usr/bin/vgyrod
/usr/lib/sysusers.d/vgyro.conf
/usr/share/bash-completion/completions/vgyro
/usr/share/bash-completion/completions/vgyrod
/usr/share/doc/vgyro/changelog.gz
/usr/share/doc/vgyro/copyright
/usr/share/doc/vgyro/examples/70-can0.link
/usr/share/doc/vgyro/examples/70-can1.link
/usr/share/doc/vgyro/examples/80-can0.network
/usr/share/doc/vgyro/examples/80-can1.network
/usr/share/man/man1/vgyro.1.gz
/usr/share/man/man5/vgyro.toml.5.gz
/usr/share/man/man8/vgyrod.8.gz
/usr/share/vgyro/monitoring/vgyro-dashboard.json
/usr/share/vgyro/monitoring/vgyro.rules.yml
/usr/share/vgyro/vgyro.dbc
/usr/share/vgyro/vgyro_axes.dbc
/usr/share/vgyro/vgyro_axes_fd.dbc
/usr/share/vgyro/vgyro_fd.dbc
""".split()


def output_of(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


class Deb(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        said = output_of(str(SOURCE / "scripts/package"), "--no-install", str(FOLDER))
        cls.deb = said.strip().splitlines()[-1]
        cls.members = {}
        for line in output_of("dpkg-deb", "--contents", cls.deb).splitlines():
            mode, owner, _, _, _, name = line.split(None, 5)
            cls.members[name.split(" -> ")[0].removeprefix(".")] = (mode, owner)

    def programs(self):
        """The path of each packaged program, in turn."""
        with tempfile.TemporaryDirectory() as folder:
            output_of("dpkg-deb", "--extract", self.deb, folder)
            for name in ("vgyro", "vgyrod"):
                with self.subTest(name=name):
                    yield Path(folder, "usr/bin", name)

    def test_the_programs_are_hardened(self):
        # Position-independent, with guarded stacks, and without writable tables of functions.
        for program in self.programs():
            seen = output_of("readelf", "--wide", "--file-header", "--dynamic", "--segments", "--dyn-syms", program)
            self.assertRegex(seen, r"Type: +DYN")
            self.assertRegex(seen, r"FLAGS_1.* NOW .*PIE")
            self.assertRegex(seen, r"GNU_RELRO")
            self.assertRegex(seen, r"GNU_STACK .* RW +0x")
            self.assertIn("__stack_chk_fail", seen)

    @unittest.skipUnless(platform.machine() == "x86_64", "other processors have other guards")
    def test_calls_and_a_growing_stack_are_guarded(self):
        for program in self.programs():
            code = output_of("objdump", "--disassemble", program)
            # Our functions are marked as branch targets. (Debian 12's start files are not, so the processor does not
            # enforce it.)
            self.assertGreater(code.count("endbr64"), 500)
            # A large stack frame touches each of its pages in turn.
            self.assertRegex(code, r"or[ql] +\$0x0,\(%rsp\)")

    def test_nothing_in_the_programs_tells_where_they_were_built(self):
        for program in self.programs():
            self.assertNotIn(f"{SOURCE.resolve()}/".encode(), program.read_bytes())

    def test_holds_every_file_where_debian_expects_it(self):
        missing = [name for name in EXPECTED if name not in self.members]
        self.assertEqual(missing, [])
        profiles = {path.name for path in (SOURCE / "dbc/profiles").glob("*.dbc")}
        packed = {Path(name).name for name in self.members if name.startswith("/usr/share/vgyro/profiles/")}
        self.assertEqual(packed - {"profiles"}, profiles)

    def test_files_belong_to_root_and_nobody_else_writes_them(self):
        for name, (mode, owner) in self.members.items():
            with self.subTest(name=name):
                self.assertEqual(owner, "root/root")
                if mode[0] != "l":
                    self.assertEqual((mode[5], mode[8]), ("-", "-"), mode)

    def test_only_what_people_edit_is_a_conffile(self):
        with tempfile.TemporaryDirectory() as folder:
            output_of("dpkg-deb", "--control", self.deb, folder)
            self.assertEqual(sorted((Path(folder) / "conffiles").read_text().split()), ["/etc/default/vgyrod", "/etc/vgyro/vgyro.toml"])

    def test_depends_on_what_its_programs_load(self):
        depends = output_of("dpkg-deb", "--field", self.deb, "Depends")
        for library in ("libc6", "libfmt9", "liblzma5", "libnettle8", "libnlopt-cxx0", "libsimdjson14", "libstdc++6", "libsystemd0"):
            self.assertRegex(depends, rf"\b{re.escape(library)}\b")

    def test_the_packed_programs_are_those_of_the_release_and_run(self):
        with tempfile.TemporaryDirectory() as folder:
            output_of("dpkg-deb", "--extract", self.deb, folder)
            version = output_of("dpkg-deb", "--field", self.deb, "Version").strip()
            for program in ("vgyro", "vgyrod"):
                self.assertEqual(output_of(f"{folder}/usr/bin/{program}", "--version").strip(), f"{program} {version}")

    def test_lintian_has_no_complaint(self):
        # Without this option, lintian refuses to run as root.
        root = ["--allow-root"] if os.geteuid() == 0 else []
        done = subprocess.run(["lintian", *root, "--fail-on", "error,warning", "--tag-display-limit", "0", self.deb],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
