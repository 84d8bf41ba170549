#pragma once
/// The memory of a ring: `count` values, the first on a cache line of its own, all touched before
/// use. Aligned because a sample of 64 bytes that lies across two lines halves what the ring
/// carries.

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
    std::uninitialized_value_construct_n(values_.get(),
                                         count);  // zeroes, and so touches, every byte
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
