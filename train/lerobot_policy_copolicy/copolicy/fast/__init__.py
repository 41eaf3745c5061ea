"""Fast sampling of action sequences: precomputed parts of the networks, ONNX Runtime, numba kernels."""
