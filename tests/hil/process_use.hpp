#pragma once
/// What a process takes over some seconds: processor time and memory.

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace abbe::tests {

class ProcessUse {
 public:
  /// Watches `pid` for `seconds`; returns when they are over.
  ProcessUse(pid_t pid, int seconds) : pid_(pid), seconds_(seconds) {
    constexpr int kLooks = 20;
    const double before_s = processor_s();
    resident_kB_.push_back(resident_kB());
    for (int passed = 0; passed < seconds;) {
      const int step = std::clamp(seconds / kLooks, 1, seconds - passed);
      ::sleep(static_cast<unsigned>(step));
      passed += step;
      resident_kB_.push_back(resident_kB());
    }
    processor_s_ = processor_s() - before_s;
  }

  /// Of one processor.
  [[nodiscard]] double percent() const { return 100.0 * processor_s_ / seconds_; }
  /// Resident memory at the end less that in the middle: without what the first half fills once.
  [[nodiscard]] long late_growth_kB() const { return resident_kB_.back() - at_half(); }
  [[nodiscard]] std::string memory() const {
    return fmt::format("{} kB at first, {} kB at half, {} kB at the end", resident_kB_.front(),
                       at_half(), resident_kB_.back());
  }

 private:
  [[nodiscard]] long at_half() const { return resident_kB_[resident_kB_.size() / 2]; }
  [[nodiscard]] double processor_s() const {
    std::ifstream stat{fmt::format("/proc/{}/stat", pid_)};
    const std::string text{std::istreambuf_iterator<char>{stat}, {}};
    std::istringstream fields{text.substr(text.rfind(')') + 2)};
    std::string skipped;
    long user = 0;
    long system = 0;
    for (int field = 3; field < 14; ++field) fields >> skipped;  // proc(5): utime is field 14
    fields >> user >> system;
    return static_cast<double>(user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }
  [[nodiscard]] long resident_kB() const {
    std::ifstream status{fmt::format("/proc/{}/status", pid_)};
    long kB = 0;
    for (std::string word; status >> word;) {
      if (word == "VmRSS:") status >> kB;
    }
    return kB;
  }

  pid_t pid_;
  int seconds_;
  std::vector<long> resident_kB_;
  double processor_s_ = 0.0;
};

}  // namespace abbe::tests
