#include "abbe/drivers/real_time_memory.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <memory>

namespace abbe::drivers {
namespace {

constexpr std::size_t kPage = 4096;
constexpr int kMB = 1 << 20;

std::string refusal(const char* tried) {
  return fmt::format("{}: {}", tried, std::strerror(errno));
}

std::vector<std::string> lock_now() {
  std::vector<std::string> refusals;
  if (prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0) != 0)
    refusals.push_back(refusal("disabling huge pages"));
  // Two calls are necessary: in one call with all three flags, MCL_ONFAULT would also apply to the
  // memory that is mapped now, which would then not be loaded.
  if (mlockall(MCL_CURRENT) != 0 || mlockall(MCL_FUTURE | MCL_ONFAULT) != 0)
    refusals.push_back(refusal("mlockall") + " (CAP_IPC_LOCK or LimitMEMLOCK=infinity is needed)");
  return refusals;
}

}  // namespace

std::vector<std::string> lock_memory() {
  static const std::vector<std::string> refusals = lock_now();
  return refusals;
}

void keep_heap() noexcept {
  (void)mallopt(M_MMAP_THRESHOLD, 32 * kMB);  // the maximum of glibc
  (void)mallopt(M_TRIM_THRESHOLD, 64 * kMB);
  (void)mallopt(M_TOP_PAD, kMB);
  // Most heaps. Threads beyond this number share a heap and its lock. glibc's default of 8 per
  // processor is less than the number of threads of abbed on a small computer.
  (void)mallopt(M_ARENA_MAX, 64);
}

[[gnu::noinline]] void touch_stack() noexcept {
  std::array<volatile char, 64 * 1024> stack;  // NOLINT: touched, not initialised, on purpose
  for (std::size_t i = 0; i < stack.size(); i += kPage) stack[i] = 0;
}

void prepare_heap_of_this_thread() {
  touch_stack();
  // Blocks of this size are taken from the heap, not mapped separately. When all are freed, the
  // heap combines them into one free area.
  constexpr std::size_t kBlock = 64 * 1024, kBlocks = 256;
  std::array<std::unique_ptr<volatile char[]>, kBlocks> blocks;  // NOLINT: an array of raw memory
  for (auto& block : blocks) {
    block.reset(new volatile char[kBlock]);
    for (std::size_t i = 0; i < kBlock; i += kPage) block[i] = 0;
  }
}

}  // namespace abbe::drivers
