#pragma once
#include <gsp/math/scalar.hpp>

namespace gsp::detail {

/// The Gaussians that a ray meets, in order, up to where no more of it is left than `stop`, or as many as there is room for. Products are
/// formed in that order and only become less where one comes between, so what lies behind the end is never needed, and nothing hangs on the
/// order in which they came.
template <class R, int room>
class SplatsMet {
 public:
  /// Begins, with so much of the ray.
  GSP_FUNCTION void begin(R coming, R stop, R most) {
    coming_ = coming;
    stop_ = stop;
    most_ = most;
    most_source_ = -1;
    count_ = 0;
  }
  /// What is not before this place counts no more.
  GSP_FUNCTION R most() const { return most_; }
  GSP_FUNCTION void add(R x, int source, R through) {
    if (!(x < most_ || (x == most_ && source < most_source_))) return;
    int at = count_ < room ? count_++ : room - 1;
    for (; at > 0 && (x < met_[at - 1].x || (x == met_[at - 1].x && source < met_[at - 1].source)); --at) met_[at] = met_[at - 1];
    R left = at > 0 ? met_[at - 1].left : coming_;
    left = left * through;
    met_[at] = {x, through, left, source};
    for (++at; at < count_ && left > stop_; ++at) {
      left = left * met_[at].through;
      met_[at].left = left;
    }
    count_ = at;
    if (left <= stop_ || count_ == room) {
      most_ = met_[count_ - 1].x;
      most_source_ = met_[count_ - 1].source;
    }
  }
  GSP_FUNCTION bool empty() const { return count_ == 0; }
  GSP_FUNCTION bool full() const { return count_ == room; }
  GSP_FUNCTION R left() const { return count_ > 0 ? met_[count_ - 1].left : coming_; }
  GSP_FUNCTION R last() const { return met_[count_ - 1].x; }
  GSP_FUNCTION int last_source() const { return met_[count_ - 1].source; }

 private:
  struct alignas(4 * sizeof(R)) Met {
    R x, through, left;
    int source;
  };
  Met met_[room];
  R coming_, stop_, most_;
  int most_source_, count_;
};

}  // namespace gsp::detail
