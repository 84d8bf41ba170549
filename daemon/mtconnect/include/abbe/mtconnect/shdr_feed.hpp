#pragma once
/// The lines that clients receive: everything when a client connects, then what changes. Not
/// thread-safe.

#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "abbe/mtconnect/observations.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::mtconnect {

class ShdrFeed {
 public:
  /// The text of a condition that stays raised is sent at most once in this time: a device that is
  /// away may report a new text with every attempt, and each fills a place of the agent's buffer.
  static constexpr std::chrono::seconds kTextPeriod{10};

  /// Lines that tell a client what changed since the last call; empty: nothing. `now` dates them.
  [[nodiscard]] std::string update(Observations observed, protocol::UtcTime now);
  /// Lines with every value that update() has sent, for a client that has just connected.
  [[nodiscard]] std::string everything(protocol::UtcTime now) const;

 private:
  /// Replaces texts of `value` that must wait for kTextPeriod by those that were sent.
  void keep_recent_texts(const std::string& name, const Value& sent, Value& value,
                         protocol::UtcTime now);

  Observations sent_ = nothing_observed();
  /// When the text was sent, by data item and native code.
  std::map<std::pair<std::string, std::string>, protocol::UtcTime> text_sent_;
};

}  // namespace abbe::mtconnect
