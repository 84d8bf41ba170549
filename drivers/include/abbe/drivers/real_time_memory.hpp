#pragma once
/// Memory of a process with real-time threads. While one thread maps memory, the kernel locks the
/// address space; a real-time thread that needs memory meanwhile waits for that lock, regardless of
/// its priority. Therefore later mappings are loaded page by page on first use, and a thread that
/// must not wait gets a heap of sufficient size before it starts.

#include <string>
#include <vector>

namespace abbe::drivers {

/// For the whole process. Memory that is mapped now is loaded and locked. Memory that is mapped
/// later is locked page by page on first use (MCL_ONFAULT): loading a vector of 33 MB or the stack
/// of a new thread at once would hold the lock of the address space for 7 to 30 ms.
/// Huge pages are disabled: the kernel thread khugepaged, which has the lowest priority, combines
/// also locked pages into huge ones. On a busy computer a device thread that touched such a page
/// meanwhile waited for 0.5 s.
/// Only the first call has an effect. Returns the settings that the system refused, one sentence
/// each. Any thread.
[[nodiscard]] std::vector<std::string> lock_memory();

/// For the whole process; call before its threads start. Freed memory stays in the heap, the heap
/// is extended in steps of 1 MB, and each thread has its own heap. Allocations up to 32 MB then
/// seldom need a system call. glibc only.
void keep_heap() noexcept;

/// Loads 64 kB of the calling thread's stack, so that the thread's loop causes no page faults
/// there.
void touch_stack() noexcept;

/// For a thread without real-time priority that must not wait for other threads (the hub of abbed,
/// which reads the rings of all devices): loads 16 MB of its heap and its stack. Call keep_heap()
/// before. Allocates.
void prepare_heap_of_this_thread();

}  // namespace abbe::drivers
