#include "abbe/sim/pseudo_terminal.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <termios.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

namespace abbe::sim {

Result<PseudoTerminal> PseudoTerminal::open(const std::string& link) {
  PseudoTerminal t;
  t.device_ = Socket{posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)};
  std::array<char, 64> path{};
  if (!t.device_ || grantpt(t.device_.get()) != 0 || unlockpt(t.device_.get()) != 0 ||
      ptsname_r(t.device_.get(), path.data(), path.size()) != 0)
    return io_error(fmt::format("{}: no pseudo terminal: {}", link, std::strerror(errno)));
  t.client_ = Socket{::open(path.data(), O_RDWR | O_NOCTTY | O_CLOEXEC)};
  termios raw{};
  if (!t.client_ || tcgetattr(t.client_.get(), &raw) != 0)
    return io_error(fmt::format("{}: {}", path.data(), std::strerror(errno)));
  cfmakeraw(&raw);
  tcsetattr(t.client_.get(), TCSANOW, &raw);
  std::error_code failed;
  if (std::filesystem::is_symlink(link)) std::filesystem::remove(link, failed);
  std::filesystem::create_symlink(path.data(), link, failed);
  if (failed) return io_error(fmt::format("{}: {}", link, failed.message()));
  t.link_ = link;

  return t;
}

void PseudoTerminal::close() {
  if (!device_) return;
  device_.close();
  client_.close();
  std::error_code ignored;
  std::filesystem::remove(link_, ignored);
}

}  // namespace abbe::sim
