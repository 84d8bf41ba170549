#include "abbe/drivers/cpu_latency.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <optional>

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// What the kernel keeps to now: the smallest of all bounds asked for.
std::optional<std::int32_t> bound_now() {
  std::ifstream file(kCpuLatencyFile, std::ios::binary);
  std::int32_t us = 0;
  if (!file.read(reinterpret_cast<char*>(&us), sizeof us)) return std::nullopt;
  return us;
}

TEST(CpuLatencyBound, IsActiveUntilItsDestruction) {
  const auto before = bound_now();
  if (!before || ::access(kCpuLatencyFile, W_OK) != 0)
    GTEST_SKIP() << kCpuLatencyFile << " cannot be used here";
  if (*before <= 77) GTEST_SKIP() << "somebody else asks for " << *before << " us";
  {
    const auto bound = CpuLatencyBound::request(77us);
    ASSERT_TRUE(bound) << bound.error().text;
    EXPECT_LE(bound_now(), 77);
  }
  EXPECT_NE(bound_now(), 77);
}

TEST(CpuLatencyBound, ReportsWhatRefusedIt) {
  const auto bound = CpuLatencyBound::request(5us, "/nowhere/cpu_dma_latency");
  ASSERT_FALSE(bound);
  EXPECT_THAT(bound.error().text, AllOf(HasSubstr("5 us"), HasSubstr("/nowhere/cpu_dma_latency"),
                                        HasSubstr("No such file")));
}

}  // namespace
}  // namespace abbe::drivers
