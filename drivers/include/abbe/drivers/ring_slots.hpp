#pragma once
/// The memory of a ring buffer: `count` values, all touched before use. The memory is aligned to
/// cache lines: a sample of 64 bytes that crosses two lines halves the throughput of the ring.

#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>

#include "abbe/drivers/ring_indices.hpp"

namespace abbe::drivers {

template <class T>
class RingSlots {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  /// Allocates.
  explicit RingSlots(std::size_t count)
      : values_(static_cast<T*>(::operator new (count * sizeof(T), std::align_val_t{kNoSharing}))) {
    // Writes zero to every byte, and thereby touches every page.
    std::uninitialized_value_construct_n(values_.get(), count);
  }
  [[nodiscard]] T& operator[](std::size_t slot) const noexcept { return values_.get()[slot]; }

 private:
  struct Release {
    void operator()(T* values) const noexcept {
      ::operator delete (values, std::align_val_t{kNoSharing});
    }
  };
  std::unique_ptr<T, Release> values_;
};

}  // namespace abbe::drivers
