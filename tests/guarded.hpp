#pragma once
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <new>

namespace gsp_test {
/// Numbers whose neighbours in memory cannot be read: what reads beside them crashes, whatever it then does with what it read. A page lies
/// closed before the first or, with `ends`, after the last of them.
template <class T>
class Guarded {
 public:
  Guarded(std::size_t size, bool ends) : page_(std::size_t(sysconf(_SC_PAGESIZE))) {
    pages_ = (size * sizeof(T) + page_ - 1) / page_ + 2;
    all_ = static_cast<std::byte*>(mmap(nullptr, pages_ * page_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    if (all_ == MAP_FAILED) throw std::bad_alloc();
    mprotect(all_, page_, PROT_NONE);
    mprotect(all_ + (pages_ - 1) * page_, page_, PROT_NONE);
    data_ = reinterpret_cast<T*>(ends ? all_ + (pages_ - 1) * page_ - size * sizeof(T) : all_ + page_);
  }
  Guarded(Guarded const&) = delete;
  Guarded& operator=(Guarded const&) = delete;
  ~Guarded() { munmap(all_, pages_ * page_); }
  T* data() const { return data_; }
  T& operator[](std::size_t i) const { return data_[i]; }

 private:
  std::size_t page_, pages_;
  std::byte* all_;
  T* data_;
};
}  // namespace gsp_test
