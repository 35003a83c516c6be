#!/usr/bin/python3
"""Checks the Debian package with dpkg-deb and lintian. tests/systemd checks its installation, upgrade and removal under a
real systemd."""

import functools
import gzip
import hashlib
import json
import os
import platform
import re
import subprocess
import tempfile
import unittest
from datetime import datetime, timedelta, timezone
from email.utils import parsedate_to_datetime
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
/usr/share/doc/vgyro/examples/commissioning/bench.csv
/usr/share/doc/vgyro/examples/commissioning/drive.csv
/usr/share/doc/vgyro/examples/commissioning/rest.csv
/usr/share/doc/vgyro/examples/commissioning/sensors.toml
/usr/share/doc/vgyro/examples/turns.csv
/usr/share/doc/vgyro/examples/turns.toml
/usr/share/doc/vgyro/examples/twin.dbc
/usr/share/doc/vgyro/examples/twin.toml
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
/usr/share/vgyro/vgyro.spdx.json
/usr/share/vgyro/vgyro_axes.dbc
/usr/share/vgyro/vgyro_axes_fd.dbc
/usr/share/vgyro/vgyro_fd.dbc
""".split()


def output_of(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


@functools.cache
def packed():
    """The package, made once."""
    return output_of(str(SOURCE / "scripts/package"), "--no-install", str(FOLDER)).strip().splitlines()[-1]


def released_s():
    """When the changelog says that this version was released."""
    changelog = (SOURCE / "debian/changelog").read_text(encoding="utf-8")
    return int(parsedate_to_datetime(re.search(r"^ -- .*>  (.*)$", changelog, re.MULTILINE).group(1)).timestamp())


class Deb(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.deb = packed()
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

    def test_nothing_in_the_package_tells_where_or_when_it_was_built(self):
        # scripts/check_reproducible builds twice; this finds what usually makes two builds differ.
        today = datetime.now(timezone.utc)
        days = {(today - timedelta(days=day)).strftime(form).encode() for day in (0, 1) for form in ("%Y-%m-%d", "%b %e %Y", "%d %b %Y")}
        released = released_s()
        self.assertNotIn(datetime.fromtimestamp(released, timezone.utc).strftime("%Y-%m-%d").encode(), days, "a release of today proves nothing")
        with tempfile.TemporaryDirectory() as folder:
            output_of("dpkg-deb", "--raw-extract", self.deb, folder)
            for path in sorted(Path(folder).rglob("*")):
                if not path.is_file() or path.is_symlink():
                    continue
                data = path.read_bytes()
                name = path.relative_to(folder).as_posix()
                if path.suffix == ".gz":
                    self.assertIn(int.from_bytes(data[4:8], "little"), (0, released), f"{name}: the date in its gzip header")
                    data = gzip.decompress(data)
                self.assertNotIn(f"{SOURCE.resolve()}/".encode(), data, name)
                for day in days:
                    self.assertNotIn(day, data, name)
                self.assertEqual(int(path.stat().st_mtime), released, f"{name} has another date than the release")
        # "!<arch>", then a header of 60 bytes for each member: name, date, …
        archive = Path(self.deb).read_bytes()
        self.assertEqual(int(archive[8 + 16:8 + 28]), released)

    def test_packing_again_gives_the_same_bytes(self):
        with tempfile.TemporaryDirectory() as folder:
            again = output_of(str(SOURCE / "scripts/package"), "--no-install", folder, env={**os.environ, "TZ": "Pacific/Chatham"}).strip().splitlines()[-1]
            self.assertEqual(Path(again).read_bytes(), Path(self.deb).read_bytes())

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


def owner_of(path):
    done = subprocess.run(["dpkg", "--search", path], capture_output=True, text=True, check=False)
    return done.stdout.split(":")[0] if done.returncode == 0 else None


class Bill(unittest.TestCase):
    """The bill of materials in the package, against the package, dpkg and ldd."""

    @classmethod
    def setUpClass(cls):
        cls.deb = packed()
        with tempfile.TemporaryDirectory() as folder:
            output_of("dpkg-deb", "--extract", cls.deb, folder)
            cls.bill = json.loads(Path(folder, "usr/share/vgyro/vgyro.spdx.json").read_text(encoding="utf-8"))
            cls.sums = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in Path(folder, "usr/bin").glob("vgyro*")}
        cls.packages = {one["name"]: one for one in cls.bill["packages"]}

    def related(self, kind):
        names = {one["SPDXID"]: one["name"] for one in self.bill["packages"]}
        return {names[one["relatedSpdxElement"]] for one in self.bill["relationships"]
                if one["relationshipType"] == kind and one["spdxElementId"] == "SPDXRef-vgyro" and one["relatedSpdxElement"] in names}

    def test_has_the_fields_of_spdx_2_3(self):
        bill = self.bill
        self.assertEqual((bill["spdxVersion"], bill["dataLicense"], bill["SPDXID"]), ("SPDX-2.3", "CC0-1.0", "SPDXRef-DOCUMENT"))
        self.assertRegex(bill["documentNamespace"], r"^https://[^#\s]+$")
        self.assertEqual(bill["creationInfo"]["created"], datetime.fromtimestamp(released_s(), timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"))
        for creator in bill["creationInfo"]["creators"]:
            self.assertRegex(creator, r"^(Tool|Organization): \S")
        ids = [one["SPDXID"] for one in bill["packages"] + bill["files"]]
        self.assertEqual(len(ids), len(set(ids)))
        for one in ids:
            self.assertRegex(one, r"^SPDXRef-[A-Za-z0-9.-]+$")
        for one in bill["relationships"]:
            self.assertIn(one["relationshipType"], ("DESCRIBES", "CONTAINS", "DYNAMIC_LINK", "BUILD_TOOL_OF"))
            self.assertTrue({one["spdxElementId"], one["relatedSpdxElement"]} <= {*ids, "SPDXRef-DOCUMENT"}, one)
        own = {one["licenseId"] for one in bill["hasExtractedLicensingInfos"]}
        for one in bill["packages"]:
            for field in ("name", "versionInfo", "supplier", "downloadLocation", "licenseConcluded", "licenseDeclared", "copyrightText"):
                self.assertTrue(one[field], one)
            self.assertIs(one["filesAnalyzed"], False)
            for licence in re.split(r" (?:AND|OR|WITH) ", one["licenseDeclared"]):
                self.assertRegex(licence, r"^[A-Za-z0-9.-]+$")
                self.assertTrue(not licence.startswith("LicenseRef-") or licence in own, licence)

    def test_the_product_is_this_package(self):
        self.assertEqual(self.packages["vgyro"]["versionInfo"], output_of("dpkg-deb", "--field", self.deb, "Version").strip())
        self.assertEqual(self.packages["vgyro"]["licenseDeclared"], "MIT")
        told = {Path(one["fileName"]).name: {sum_["algorithm"]: sum_["checksumValue"] for sum_ in one["checksums"]}["SHA256"] for one in self.bill["files"]}
        self.assertEqual(told, {name: self.sums[name] for name in ("vgyro", "vgyrod")})

    def test_every_library_that_the_programs_load_is_listed(self):
        linked = self.related("DYNAMIC_LINK")
        for name in ("vgyro", "vgyrod"):
            loaded = re.findall(r"(/\S+) \(0x", output_of("ldd", SOURCE / "build/release/bin" / name))
            self.assertGreater(len(loaded), 8)
            for path in loaded:
                owner = next(found for found in map(owner_of, {os.path.realpath(path), os.path.realpath(path).removeprefix("/usr")}) if found)
                self.assertIn(owner, linked, path)

    def test_what_is_compiled_in_is_listed(self):
        parts = self.related("CONTAINS")
        for name in ("libeigen3-dev", "libtomlplusplus-dev", "libcli11-dev", "nlohmann-json3-dev", "libexpected-dev", "libfmt-dev", "libjs-dygraphs"):
            self.assertIn(name, parts)
        # Tests alone use these.
        self.assertFalse(parts & {"libgtest-dev", "libgmock-dev", "libbenchmark-dev"})
        self.assertIn("g++-12", self.packages)

    def test_versions_are_those_of_dpkg(self):
        for name, one in self.packages.items():
            if name == "vgyro":
                continue
            installed = output_of("dpkg-query", "--show", "--showformat", "${Version}\n", name).split()
            self.assertIn(one["versionInfo"], installed, name)
            self.assertRegex(one["externalRefs"][0]["referenceLocator"], rf"^pkg:deb/debian/{re.escape(name)}@")


if __name__ == "__main__":
    unittest.main()
