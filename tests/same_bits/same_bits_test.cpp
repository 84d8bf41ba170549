/// The results of identification, bit for bit, on other processors.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

namespace {

struct Output {
  std::string lines;
  int status = -1;
};

Output output_of(const std::string& command) {
  Output out;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return out;
  char line[256];
  while (std::fgets(line, sizeof line, pipe) != nullptr) out.lines += line;
  out.status = ::pclose(pipe);
  return out;
}

const std::string& native() {
  static const std::string lines = output_of(ABBE_IDENTIFY).lines;
  return lines;
}

void expect_the_same(const std::string& command) {
  const Output other = output_of(command);
  EXPECT_EQ(other.status, 0) << command;
  EXPECT_EQ(other.lines, native()) << command;
}

TEST(SameBits, PrintsAHashOfEveryResult) {
  for (const char* name : {"elementary", "spherical", "on-the-fly, segments", "on-the-fly, samples",
                           "on-the-fly, correlated noise", "on-the-fly, verdict",
                           "ball array, bayes-pose", "ball array, scad"})
    EXPECT_NE(native().find(std::string(name) + ' '), std::string::npos) << name;
}

/// In the preset dev also by another compiler.
TEST(SameBits, WithAnotherOptimisation) {
  expect_the_same(ABBE_IDENTIFY_X86_64);
}

/// No AVX, no fused multiply-add, small caches.
TEST(SameBits, OnAProcessorOf2008) {
  expect_the_same(ABBE_QEMU_X86_64 " -cpu Nehalem " ABBE_IDENTIFY_X86_64);
}

/// AVX2 and fused multiply-add, where this processor does not have them itself.
TEST(SameBits, OnAProcessorOf2013) {
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    GTEST_SKIP() << "this processor has AVX2 and FMA: the test without emulation covers them";
  }
  expect_the_same(ABBE_QEMU_X86_64 " -cpu max " ABBE_IDENTIFY_X86_64);
}

TEST(SameBits, OnAarch64) {
  expect_the_same(ABBE_QEMU_AARCH64 " -L /usr/aarch64-linux-gnu " ABBE_IDENTIFY_AARCH64);
}

}  // namespace
