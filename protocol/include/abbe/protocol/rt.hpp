#pragma once
/// Marks a function of the real-time path (bytes in our buffer -> sample in the ring): no
/// allocation, lock, system call, log, exception or unbounded loop. Proven for every driver by the
/// tests labelled `rt`.

#if defined(__has_cpp_attribute) && defined(__clang__)
#if __has_cpp_attribute(clang::nonblocking)
#define ABBE_RT noexcept [[clang::nonblocking]]
#endif
#endif
#ifndef ABBE_RT
#define ABBE_RT noexcept
#endif
