#include "abbe/sim/terminal_server.hpp"

#include <unistd.h>

#include <array>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::sim {

Result<TerminalServer> TerminalServer::open(const std::string& link,
                                            std::unique_ptr<RecordedDialogue> device,
                                            HostTime now) {
  auto terminal = PseudoTerminal::open(link);
  ABBE_TRY(terminal);
  device->connected(now);
  return TerminalServer(std::move(*terminal), link, std::move(device));
}

void TerminalServer::poll(HostTime now) {
  read(now);
  device_->advance(now);
  write();
  if (!device_->wants_close() || !unsent_.empty()) return;
  terminal_.close();
  device_->disconnected();
  if (auto again = PseudoTerminal::open(link_)) terminal_ = std::move(*again);
}

void TerminalServer::read(HostTime now) {
  std::array<std::byte, 1024> buffer;  // NOLINT: filled by read
  for (ssize_t size = 1; size > 0;) {
    size = ::read(terminal_.fd(), buffer.data(), buffer.size());
    if (size > 0) device_->receive(std::span(buffer).first(static_cast<std::size_t>(size)), now);
  }
}

void TerminalServer::write() {
  const std::vector<std::byte> more = device_->take_output();
  unsent_.insert(unsent_.end(), more.begin(), more.end());
  if (unsent_.empty()) return;
  const ssize_t size = ::write(terminal_.fd(), unsent_.data(), unsent_.size());
  if (size > 0) unsent_.erase(unsent_.begin(), unsent_.begin() + size);
}

}  // namespace abbe::sim
