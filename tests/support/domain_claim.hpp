#pragma once
/// A DDS domain that no other test on this computer uses at the same time.

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace abbe::test {

/// Selects one of the domains 1 to 100, whose ports are below the kernel's ephemeral ports. A file
/// lock reserves it until this process ends.
class DomainClaim {
 public:
  DomainClaim() {
    for (int i = 0; i < 100 && fd_ < 0; ++i) {
      number_ = 1 + (static_cast<int>(::getpid()) + i) % 100;
      const auto file =
          std::filesystem::temp_directory_path() / ("abbe-test-domain-" + std::to_string(number_));
      fd_ = ::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
      if (fd_ >= 0 && ::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
        ::close(fd_);
        fd_ = -1;
      }
    }
  }
  ~DomainClaim() { ::close(fd_); }
  DomainClaim(const DomainClaim&) = delete;
  DomainClaim& operator=(const DomainClaim&) = delete;
  [[nodiscard]] std::string text() const { return std::to_string(number_); }

 private:
  int fd_ = -1;
  int number_ = 0;
};

}  // namespace abbe::test
