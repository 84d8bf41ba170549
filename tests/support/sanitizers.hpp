#pragma once
/// The sanitizer with which a file is compiled, as macros: GCC defines __SANITIZE_..., Clang has
/// __has_feature().

#if defined(__SANITIZE_ADDRESS__)
#define ABBE_ADDRESS_SANITIZER
#elif defined(__SANITIZE_THREAD__)
#define ABBE_THREAD_SANITIZER
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define ABBE_ADDRESS_SANITIZER
#elif __has_feature(thread_sanitizer)
#define ABBE_THREAD_SANITIZER
#elif __has_feature(memory_sanitizer)
#define ABBE_MEMORY_SANITIZER
#endif
#endif

// Runs beside the address sanitizer, or alone.
#if defined(__has_feature)
#if __has_feature(undefined_behavior_sanitizer)
#define ABBE_UNDEFINED_SANITIZER
#endif
#endif
