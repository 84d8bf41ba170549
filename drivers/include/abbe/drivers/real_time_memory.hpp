#pragma once
/// Memory of a process with real-time threads. Mapping memory holds the kernel's lock of the
/// address space; a real-time thread that needs memory meanwhile waits for it, whatever its
/// priority. So later mappings are not loaded at once, and the heap of a thread that must not wait
/// is large enough before it starts.

#include <string>
#include <vector>

namespace abbe::drivers {

/// For the whole process. What is mapped now is loaded and stays in memory. What is mapped later
/// stays from its first use on (MCL_ONFAULT): loading a vector of 33 MB or the stack of a new
/// thread at once holds the lock of the address space for 7 to 30 ms. No huge pages: locked pages
/// are still gathered into huge ones by khugepaged, an ordinary thread of the lowest priority; on a
/// busy computer a device thread that touched one meanwhile waited for 0.5 s.
/// Once: later calls change nothing. Returns what the system refused, one sentence each. Any
/// thread.
[[nodiscard]] std::vector<std::string> lock_memory();

/// For the whole process, before its threads start: freed memory stays in the heap, which grows in
/// steps of 1 MB, and each thread has a heap of its own. Allocations up to 32 MB then seldom ask
/// the kernel. glibc only.
void keep_heap() noexcept;

/// Uses 64 kB of the calling thread's stack: its loop does not load them page by page.
void touch_stack() noexcept;

/// For an ordinary thread that must not wait for others, the hub: 16 MB of its heap and its stack
/// are loaded. Needs keep_heap() before. Allocates.
void prepare_heap_of_this_thread();

}  // namespace abbe::drivers
