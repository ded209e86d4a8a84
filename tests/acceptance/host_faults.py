"""A host with a wrong clock and a failing disk, simulated by a preloaded library; see host_faults.c."""
import errno
import mmap
import os
import pathlib
import shutil
import struct
import subprocess

from harness import skip

WRITES, READS, SYNCS = 1, 2, 4


class HostFaults:
    def __init__(self, folder, files="history.db"):
        """`folder` contains the library and its file of faults; `files`: a part of the names of failing files."""
        if shutil.which("cc") is None:
            skip("no C compiler")
        library, control = os.path.join(folder, "host_faults.so"), os.path.join(folder, "host_faults")
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, pathlib.Path(__file__).with_suffix(".c")],
                       check=True)
        pathlib.Path(control).write_bytes(bytes(24))
        self.shared = mmap.mmap(os.open(control, os.O_RDWR), 24)
        # The sanitizer's library must be the first.
        self.environment = {"LD_PRELOAD": library, "HOST_FAULTS": control, "HOST_FAULTS_FILE": files,
                            "ASAN_OPTIONS": "verify_asan_link_order=0"}

    def set_clock(self, ahead_s):
        self.shared[:8] = struct.pack("q", ahead_s)

    def fail_disk(self, what, how=errno.EIO):
        """`what` is a sum of WRITES, READS and SYNCS; 0 ends the fault."""
        self.shared[16:24] = struct.pack("q", how)
        self.shared[8:16] = struct.pack("q", what)
