"""The same action chunks in less time: packed weights, ONNX Runtime, numba."""
