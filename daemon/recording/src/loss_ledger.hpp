#pragma once
/// Counts messages by stream and device, for example those lost since the last recorded one. Has
/// only a few entries; for one thread.

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "streams.hpp"

namespace abbe::daemon::recording {

class LossLedger {
 public:
  void add(Stream stream, std::string_view device, std::uint32_t messages) {
    if (const auto at = find(stream, device); at != entries_.end()) {
      at->messages += messages;
    } else {
      entries_.push_back({stream, std::string{device}, messages});
    }
  }
  void add(const LossLedger& other) {
    for (const Entry& e : other.entries_) add(e.stream, e.device, e.messages);
  }
  /// Returns the count and resets it to 0.
  [[nodiscard]] std::uint32_t take(Stream stream, std::string_view device) {
    const auto at = find(stream, device);
    return at == entries_.end() ? 0 : std::exchange(at->messages, 0);
  }
  void clear() noexcept {
    for (Entry& e : entries_) e.messages = 0;
  }

 private:
  struct Entry {
    Stream stream;
    std::string device;
    std::uint32_t messages;
  };
  [[nodiscard]] std::vector<Entry>::iterator find(Stream stream, std::string_view device) {
    return std::find_if(entries_.begin(), entries_.end(),
                        [&](const Entry& e) { return e.stream == stream && e.device == device; });
  }

  std::vector<Entry> entries_;
};

}  // namespace abbe::daemon::recording
