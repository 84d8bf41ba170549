#pragma once
/// A simulated serial line: a client opens the link as it would open /dev/ttyUSB0. Both ends
/// are held open, so that the line stays usable while no client has it open. Non-blocking. Not
/// thread-safe.

#include <string>

#include "abbe/sim/error.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

class PseudoTerminal {
 public:
  PseudoTerminal() = default;  ///< closed
  /// Creates the symbolic link `link` to the client's end; an existing link is replaced. Error Io:
  /// there is no pseudo terminal or the link cannot be created.
  [[nodiscard]] static Result<PseudoTerminal> open(const std::string& link);
  PseudoTerminal(PseudoTerminal&& other) noexcept = default;
  PseudoTerminal& operator=(PseudoTerminal&& other) noexcept = default;
  ~PseudoTerminal() { close(); }

  /// Simulates unplugging: a client that has the line open gets a read error; the link is removed.
  void close();
  /// The device's end; -1 when closed.
  [[nodiscard]] int fd() const { return device_.get(); }

 private:
  Socket device_;
  Socket client_;
  std::string link_;
};

}  // namespace abbe::sim
