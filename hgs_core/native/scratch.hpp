// Memory that is kept between calls: the pages of fresh buffers would cost more than the work done in them.
#pragma once
#include <cstddef>
#include <cstdlib>
#include <new>

namespace hgs {

// A buffer that only grows and does not keep its content when it does. The caller asks for a size on every use.
template <class T>
class Scratch {
 public:
  Scratch() = default;
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() { std::free(data_); }

  // Always inlined: the variants are compiled with instructions that the shared copy must not contain.
  [[gnu::always_inline]] T* require(std::size_t count) {
    if (count > capacity_) {
      std::free(data_);
      data_ = nullptr;
      capacity_ = 0;
      const std::size_t wanted = count + count / 4 + 64;
      const std::size_t bytes = (wanted * sizeof(T) + 127) / 64 * 64;
      data_ = static_cast<T*>(std::aligned_alloc(64, bytes));
      if (data_ == nullptr) throw std::bad_alloc();
      capacity_ = wanted;
    }
    return data_;
  }
  [[gnu::always_inline]] T* get() const { return data_; }

 private:
  T* data_ = nullptr;
  std::size_t capacity_ = 0;
};

}  // namespace hgs
