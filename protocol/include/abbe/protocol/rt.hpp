#pragma once
/// Marks a function of the real-time path (from the bytes in the driver's buffer to the sample in
/// the ring). It must not allocate, lock, make a system call, log, throw or loop without bound. The
/// tests labelled `rt` verify this for every driver.

#if defined(__has_cpp_attribute) && defined(__clang__)
#if __has_cpp_attribute(clang::nonblocking)
#define ABBE_RT noexcept [[clang::nonblocking]]
#endif
#endif
#ifndef ABBE_RT
#define ABBE_RT noexcept
#endif
