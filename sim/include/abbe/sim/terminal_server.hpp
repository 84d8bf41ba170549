#pragma once
/// Serves a recorded device behind a pseudo terminal, as ControllerServer does behind a TCP port.
/// Where the connection broke in the recording, the terminal is closed and opened again. Steppable:
/// poll(now) never blocks and reads no clock. Not thread-safe.

#include <memory>
#include <string>
#include <vector>

#include "abbe/sim/pseudo_terminal.hpp"
#include "abbe/sim/recorded_dialogue.hpp"

namespace abbe::sim {

class TerminalServer {
 public:
  /// `link`: path of the symbolic link that the client opens.
  [[nodiscard]] static Result<TerminalServer> open(const std::string& link,
                                                   std::unique_ptr<RecordedDialogue> device,
                                                   HostTime now);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const { return device_->next_due(); }
  [[nodiscard]] int fd() const { return terminal_.fd(); }
  [[nodiscard]] bool wants_write() const { return !unsent_.empty(); }
  [[nodiscard]] const std::string& link() const { return link_; }
  [[nodiscard]] const RecordedDialogue& device() const { return *device_; }

 private:
  TerminalServer(PseudoTerminal terminal, std::string link,
                 std::unique_ptr<RecordedDialogue> device)
      : terminal_(std::move(terminal)), link_(std::move(link)), device_(std::move(device)) {}
  void read(HostTime now);
  void write();

  PseudoTerminal terminal_;
  std::string link_;
  std::unique_ptr<RecordedDialogue> device_;
  std::vector<std::byte> unsent_;
};

}  // namespace abbe::sim
