"""Arrays of npz files, for the tests of the program, without numpy."""
import ast
import math
import struct
import zipfile


def array(file, name):
    """Shape and numbers of an array of an npz file."""
    b = zipfile.ZipFile(file).read(name + ".npy")
    n = struct.unpack("<H", b[8:10])[0]
    head = ast.literal_eval(b[10:10 + n].decode())
    kind = {"<f4": "f", "<f8": "d", "<i4": "i", "|u1": "B"}[head["descr"]]
    data = b[10 + n:]
    return head["shape"], struct.unpack("<%d%s" % (len(data) // struct.calcsize(kind), kind), data)


def write_npz(file, **arrays):
    """Arrays of float64: name=(shape, numbers)."""
    with zipfile.ZipFile(file, "w") as archive:
        for name, (shape, numbers) in arrays.items():
            head = "{'descr': '<f8', 'fortran_order': False, 'shape': (%s), }" % "".join("%d," % n for n in shape)
            head += " " * (63 - (10 + len(head)) % 64) + "\n"
            archive.writestr(name + ".npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + struct.pack("<%dd" % len(numbers), *numbers))


def psnr(a, b, k):
    """Of picture k of two files of gsp render, cut off at 1 as a screen does."""
    (shape, x), (_, y) = array(a, "rgb"), array(b, "rgb")
    n = shape[1] * shape[2] * shape[3]
    mean = sum((min(p, 1) - min(q, 1)) ** 2 for p, q in zip(x[k * n:(k + 1) * n], y[k * n:(k + 1) * n])) / n
    return -10 * math.log10(mean) if mean > 0 else math.inf
