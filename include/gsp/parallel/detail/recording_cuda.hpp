#pragma once
#include <gsp/parallel/detail/launch_cuda.hpp>
#include <gsp/parallel/recording.hpp>
#include <utility>

namespace gsp {

template <>
class Recording<Kokkos::Cuda> {
 public:
  Recording() = default;
  Recording(Recording const&) = delete;
  Recording& operator=(Recording const&) = delete;
  Recording(Recording&& other) noexcept : exec_(std::exchange(other.exec_, nullptr)) {}
  Recording& operator=(Recording&& other) noexcept {
    std::swap(exec_, other.exec_);
    return *this;
  }
  ~Recording() { clear(); }

  bool exists() const { return exec_ != nullptr; }
  template <class F>
  bool record(Kokkos::Cuda const& exec, F const& f) {
    clear();
    if (Kokkos::Tools::profileLibraryLoaded()) return false;
    detail::cuda_expects(cudaSetDevice(exec.cuda_device()), "gsp::Recording");
    Graph graph;
    {
      Capture capture{exec.cuda_stream()};
      f();
      capture.end(graph);
    }
    if (!stands_alone(graph.graph)) return false;
    detail::cuda_expects(cudaGraphInstantiate(&exec_, graph.graph, 0), "gsp::Recording: a graph");
    return true;
  }
  void launch(Kokkos::Cuda const& exec) const {
    detail::cuda_expects(cudaSetDevice(exec.cuda_device()), "gsp::Recording");
    detail::cuda_expects(cudaGraphLaunch(exec_, exec.cuda_stream()), "gsp::Recording: launching a graph");
  }
  void clear() {  // CUDA may be gone: what it says then is of no use
    if (exec_) static_cast<void>(cudaGraphExecDestroy(std::exchange(exec_, nullptr)));
  }

 private:
  struct Graph {
    cudaGraph_t graph = nullptr;
    Graph() = default;
    Graph(Graph const&) = delete;
    Graph& operator=(Graph const&) = delete;
    ~Graph() {
      if (graph) static_cast<void>(cudaGraphDestroy(graph));
    }
  };
  /// A stream that records, until `end`, or an exception leaves.
  struct Capture {
    cudaStream_t stream;
    bool open = true;
    explicit Capture(cudaStream_t s) : stream(s) {
      detail::cuda_expects(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "gsp::Recording: a stream that records");
    }
    Capture(Capture const&) = delete;
    Capture& operator=(Capture const&) = delete;
    void end(Graph& to) {
      open = false;
      detail::cuda_expects(cudaStreamEndCapture(stream, &to.graph), "gsp::Recording: what was launched cannot be recorded");
    }
    ~Capture() {
      Graph left;
      if (open) static_cast<void>(cudaStreamEndCapture(stream, &left.graph));
    }
  };
  /// Whether it has kernels, settings of memory and order alone. A copy would read the host's memory when the graph is launched, where
  /// something else may be by then: Kokkos copies functors of more than 4 kB from the stack.
  static bool stands_alone(cudaGraph_t graph) {
    std::size_t count = 0;
    detail::cuda_expects(cudaGraphGetNodes(graph, nullptr, &count), "gsp::Recording");
    std::vector<cudaGraphNode_t> nodes(count);
    detail::cuda_expects(cudaGraphGetNodes(graph, nodes.data(), &count), "gsp::Recording");
    for (auto const node : nodes) {
      cudaGraphNodeType type;
      detail::cuda_expects(cudaGraphNodeGetType(node, &type), "gsp::Recording");
      if (type != cudaGraphNodeTypeKernel && type != cudaGraphNodeTypeMemset && type != cudaGraphNodeTypeEmpty) return false;
    }
    return true;
  }
  cudaGraphExec_t exec_ = nullptr;
};

}  // namespace gsp
