#pragma once
/// A serial line without wires: a client opens the link as it would open /dev/ttyUSB0. Both ends
/// are held open, so that the line stays usable while no client is there. Non-blocking. Not
/// thread-safe.

#include <string>

#include "abbe/sim/error.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

class PseudoTerminal {
 public:
  PseudoTerminal() = default;  ///< closed
  /// The client's end appears as the symbolic link `link`, which is replaced if it is there
  /// already. Io: no pseudo terminal, link not to be made.
  [[nodiscard]] static Result<PseudoTerminal> open(const std::string& link);
  PseudoTerminal(PseudoTerminal&& other) noexcept = default;
  PseudoTerminal& operator=(PseudoTerminal&& other) noexcept = default;
  ~PseudoTerminal() { close(); }

  /// Unplugged: a client that has it open reads an error; the link is gone.
  void close();
  /// The device's end; -1 when closed.
  [[nodiscard]] int fd() const { return device_.get(); }

 private:
  Socket device_;
  Socket client_;
  std::string link_;
};

}  // namespace abbe::sim
