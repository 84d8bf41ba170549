// What the programs that face the network contain.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <memory>
#include <string>

namespace {

/// The names of the functions and variables of a program, a line each.
std::string symbols_of(const std::string& program) {
  const std::unique_ptr<FILE, int (*)(FILE*)> nm(::popen(("nm -C " + program).c_str(), "r"),
                                                 &::pclose);
  std::string text;
  std::array<char, 65536> part{};
  while (const std::size_t size = std::fread(part.data(), 1, part.size(), nm.get()))
    text.append(part.data(), size);
  return text;
}

TEST(DdsPrograms, ContainNothingOfCalib) {
  for (const char* program : {ABBE_DDS_PROGRAM, ABBE_WATCH_PROGRAM}) {
    const std::string symbols = symbols_of(program);
    EXPECT_NE(symbols.find("abbe::dds::"), std::string::npos) << program << ": nm shows no names";
    EXPECT_EQ(symbols.find("abbe::calib::"), std::string::npos) << program;
  }
}

}  // namespace
