#pragma once
/// Counts operations that could make the calling thread wait for another thread: locking of
/// mutexes, condition variables and read-write locks, and starts of threads. Include it in one
/// source file of a test binary: the dynamic linker prefers the program's own functions to those of
/// the C library. Locks inside the C library (malloc, stdio) are not counted. With a sanitizer
/// nothing is counted: it replaces these functions.

#include <dlfcn.h>
#include <pthread.h>

#include <cstdint>

#include "sanitizers.hpp"

#if defined(ABBE_ADDRESS_SANITIZER) || defined(ABBE_THREAD_SANITIZER) || \
    defined(ABBE_MEMORY_SANITIZER)
#define ABBE_SANITIZER_LOCKS 1
#endif

namespace abbe::tests {

inline thread_local std::uint64_t locks_of_this_thread = 0;

#ifdef ABBE_SANITIZER_LOCKS
inline constexpr bool kLocksAreCounted = false;
#else
inline constexpr bool kLocksAreCounted = true;
#endif

/// Number of locks that this thread has taken since construction.
class LockCount {
 public:
  [[nodiscard]] std::uint64_t value() const noexcept { return locks_of_this_thread - begin_; }

 private:
  std::uint64_t begin_ = locks_of_this_thread;
};

/// The function of that name in the C library.
template <class Function>
Function* next_of(const char* name) noexcept {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));  // NOLINT: as POSIX says of dlsym()
}

}  // namespace abbe::tests

#ifndef ABBE_SANITIZER_LOCKS
#define ABBE_COUNTED(name, parameters, arguments)                          \
  int name parameters noexcept {                                           \
    static auto* const next = abbe::tests::next_of<int parameters>(#name); \
    ++abbe::tests::locks_of_this_thread;                                   \
    return next arguments;                                                 \
  }

extern "C" {
ABBE_COUNTED(pthread_mutex_lock, (pthread_mutex_t * mutex), (mutex))
ABBE_COUNTED(pthread_mutex_trylock, (pthread_mutex_t * mutex), (mutex))
ABBE_COUNTED(pthread_rwlock_rdlock, (pthread_rwlock_t * lock), (lock))
ABBE_COUNTED(pthread_rwlock_wrlock, (pthread_rwlock_t * lock), (lock))
ABBE_COUNTED(pthread_create,
             (pthread_t * thread, const pthread_attr_t* attributes, void* (*begin)(void*),
              void* argument),
             (thread, attributes, begin, argument))
}
#undef ABBE_COUNTED
#endif
