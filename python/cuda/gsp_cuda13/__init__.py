"""The compiled module of `gsp` for NVIDIA's GPUs, and the CPU's beside it: `import gsp` takes it where a GPU answers."""

__version__ = "0.1.0"
