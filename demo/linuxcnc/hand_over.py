"""The shared memory of abbe_correction (linuxcnc/realtime/hand_over.h), for the faults of the demo: which
process feeds, and a feeder that sends what it should not."""
import contextlib
import ctypes

KEY, SIZE, REASON = 0x41424245, 4096, 160


class Sequence(ctypes.Structure):
    _fields_ = [("begin", ctypes.c_uint32), ("end", ctypes.c_uint32)]


class Control(ctypes.Structure):
    _fields_ = [("cycle", ctypes.c_uint64), ("position", ctypes.c_double * 3),
                ("tool_offset", ctypes.c_double * 3), ("tool_number", ctypes.c_int32),
                ("tool", ctypes.c_uint32), ("homed", ctypes.c_uint32)]


class Wanted(ctypes.Structure):
    _fields_ = [("correction", ctypes.c_double * 3), ("valid", ctypes.c_uint32),
                ("reason", ctypes.c_char * REASON)]


class HandOver(ctypes.Structure):
    _fields_ = [("version", ctypes.c_uint32), ("closed", ctypes.c_uint32), ("feeder", ctypes.c_int32),
                ("control_sequence", Sequence), ("wanted_sequence", Sequence), ("control", Control),
                ("wanted", Wanted)]

    def write(self, correction_mm):
        number = self.wanted_sequence.end + 1
        self.wanted_sequence.begin = number
        self.wanted.correction[:] = correction_mm
        self.wanted.valid = 1
        self.wanted_sequence.end = number


@contextlib.contextmanager
def attached():
    libc = ctypes.CDLL(None, use_errno=True)
    libc.shmat.restype = ctypes.c_void_p
    segment = libc.shmget(KEY, SIZE, 0o600)
    place = libc.shmat(segment, None, 0)
    if segment < 0 or place == ctypes.c_void_p(-1).value:
        raise OSError(ctypes.get_errno(), "the shared memory of abbe_correction")
    try:
        yield HandOver.from_address(place)
    finally:
        libc.shmdt(ctypes.c_void_p(place))
