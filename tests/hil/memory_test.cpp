// Memory of a real-time process. Here and not in ctest: sanitizers replace mlockall and the heap.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "abbe/drivers/real_time_memory.hpp"

namespace abbe::tests {
namespace {

constexpr std::size_t kPage = 4096;

/// Anonymous memory as a large vector would get it.
class Mapping {
 public:
  Mapping()
      : bytes_(static_cast<char*>(::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, kFlags, -1, 0))) {
  }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  ~Mapping() { ::munmap(bytes_, kBytes); }

  [[nodiscard]] char& operator[](std::size_t i) { return bytes_[i]; }
  [[nodiscard]] std::size_t resident_pages() const {
    std::vector<unsigned char> resident(kBytes / kPage);
    EXPECT_EQ(::mincore(bytes_, kBytes, resident.data()), 0);
    return static_cast<std::size_t>(std::count_if(resident.begin(), resident.end(),
                                                  [](auto page) { return (page & 1U) != 0; }));
  }

 private:
  static constexpr std::size_t kBytes = 33 << 20;
  static constexpr int kFlags = MAP_PRIVATE | MAP_ANONYMOUS;
  char* bytes_;
};

/// Sum of the lines "Locked: N kB" of the process.
std::size_t locked_pages() {
  std::ifstream smaps{"/proc/self/smaps"};
  std::size_t kB = 0;
  for (std::string line; std::getline(smaps, line);)
    if (line.starts_with("Locked:")) kB += std::stoul(line.substr(7));
  return kB * 1024 / kPage;
}

long page_faults_of_this_thread() {
  rusage use{};
  EXPECT_EQ(::getrusage(RUSAGE_THREAD, &use), 0);
  return use.ru_minflt + use.ru_majflt;
}

/// 8 MB in pieces as messages and samples are.
void allocate() {
  constexpr std::size_t kPiece = 1000, kPieces = 8000;
  std::vector<std::string> pieces(kPieces);
  for (auto& piece : pieces) piece.assign(kPiece, 'a');
}

TEST(RealTimeMemory, IsLockedFromItsFirstUseOn) {
  ASSERT_TRUE(drivers::lock_memory().empty());
  Mapping later;
  EXPECT_EQ(later.resident_pages(), 0U);  // mapping it took no time
  const std::size_t before = locked_pages();
  later[0] = 1;
  EXPECT_EQ(later.resident_pages(), 1U);
  EXPECT_GE(locked_pages(), before + 1);
  ::munlockall();
}

TEST(RealTimeMemory, APreparedThreadAllocatesWithoutPageFaults) {
  drivers::keep_heap();
  long faults = -1;
  std::thread{[&faults] {
    drivers::prepare_heap_of_this_thread();
    const long before = page_faults_of_this_thread();
    allocate();
    faults = page_faults_of_this_thread() - before;
  }}.join();
  EXPECT_EQ(faults, 0);
}

}  // namespace
}  // namespace abbe::tests
