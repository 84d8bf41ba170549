#pragma once
/// A DDS domain that no other test on this computer uses at the same time.

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/file_descriptor.hpp"

namespace abbe::test {

/// Selects one of the domains 1 to 100, whose ports are below the kernel's ephemeral ports. File
/// locks reserve it until this process ends, and with `domains` > 1 those that follow: participants
/// beyond the 120th use the ports of the next domain [DDSI-RTPS 2.5, 9.6.2.3].
class DomainClaim {
 public:
  explicit DomainClaim(int domains = 1) {
    for (int i = 0; i < 100 && number_ == 0; ++i) claim(1 + (::getpid() + i) % 100, domains);
  }
  [[nodiscard]] std::string text() const { return std::to_string(number_); }

 private:
  void claim(int first, int domains) {
    std::vector<daemon::FileDescriptor> locks;
    for (int number = first; number < first + domains; ++number) {
      const auto file =
          std::filesystem::temp_directory_path() / ("abbe-test-domain-" + std::to_string(number));
      locks.emplace_back(::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666));
      if (!locks.back() || ::flock(locks.back().get(), LOCK_EX | LOCK_NB) != 0) return;
    }
    locks_ = std::move(locks);
    number_ = first;
  }

  std::vector<daemon::FileDescriptor> locks_;
  int number_ = 0;
};

}  // namespace abbe::test
