#pragma once
/// Counts the heap allocations of the calling thread, by malloc and operator new. Include it
/// anywhere in a test binary: plain builds interpose glibc's malloc family, sanitizer builds use
/// the sanitizer's own hook, so both kinds keep their allocator. Deallocation is not counted:
/// without an allocation there is none.

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "sanitizers.hpp"

namespace abbe::tests {

inline thread_local std::uint64_t allocations_of_this_thread = 0;

/// Allocations of this thread since construction.
class AllocationCount {
 public:
  AllocationCount();
  [[nodiscard]] std::uint64_t value() const noexcept { return allocations_of_this_thread - begin_; }

 private:
  std::uint64_t begin_;
};

}  // namespace abbe::tests

#if defined(ABBE_ADDRESS_SANITIZER) || defined(ABBE_THREAD_SANITIZER)

// Declared here because <sanitizer/allocator_interface.h> does not come with every compiler
// package.
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*on_malloc)(const volatile void*,
                                                                           std::size_t),
                                                         void (*on_free)(const volatile void*));

namespace abbe::tests {
inline AllocationCount::AllocationCount() : begin_(0) {
  static const int installed = __sanitizer_install_malloc_and_free_hooks(
      [](const volatile void*, std::size_t) { ++allocations_of_this_thread; },
      [](const volatile void*) {});
  if (installed == 0) std::abort();  // without the hook the count would always be zero
  begin_ = allocations_of_this_thread;
}
}  // namespace abbe::tests

#else

// The dynamic linker prefers the program's own malloc to glibc's; glibc's stays reachable under its
// internal names.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

[[gnu::weak]] void* malloc(std::size_t size) noexcept {
  ++abbe::tests::allocations_of_this_thread;
  return __libc_malloc(size);
}
[[gnu::weak]] void* calloc(std::size_t count, std::size_t size) noexcept {
  ++abbe::tests::allocations_of_this_thread;
  return __libc_calloc(count, size);
}
[[gnu::weak]] void* realloc(void* old, std::size_t size) noexcept {
  ++abbe::tests::allocations_of_this_thread;
  return __libc_realloc(old, size);
}
[[gnu::weak]] void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++abbe::tests::allocations_of_this_thread;
  return __libc_memalign(alignment, size);
}
[[gnu::weak]] int posix_memalign(void** out, std::size_t alignment, std::size_t size) noexcept {
  ++abbe::tests::allocations_of_this_thread;
  *out = __libc_memalign(alignment, size);
  return *out == nullptr ? ENOMEM : 0;
}
}

namespace abbe::tests {
inline AllocationCount::AllocationCount() : begin_(allocations_of_this_thread) {}
}  // namespace abbe::tests

#endif
