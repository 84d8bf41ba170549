#pragma once
/// The lines that clients receive: all values when a client connects, afterwards only the values
/// that change. Not thread-safe.

#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "abbe/mtconnect/observations.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::mtconnect {

class ShdrFeed {
 public:
  /// The text of a condition that stays raised is sent at most once in this time. A disconnected
  /// device may report a new text with every attempt to connect, and each text takes a place in the
  /// agent's buffer.
  static constexpr std::chrono::seconds kTextPeriod{10};

  /// Lines with the values that changed since the last call; empty: none. `now` is the time stamp
  /// of the lines.
  [[nodiscard]] std::string update(Observations observed, protocol::UtcTime now);
  /// Lines with every value that update() has sent, for a client that has just connected.
  [[nodiscard]] std::string everything(protocol::UtcTime now) const;

 private:
  /// Replaces each text in `value` that may not be sent yet because of kTextPeriod by the text that
  /// was sent last.
  void keep_recent_texts(const std::string& name, const Value& sent, Value& value,
                         protocol::UtcTime now);

  Observations sent_ = nothing_observed();
  /// Time at which the last text was sent, by data item and native code.
  std::map<std::pair<std::string, std::string>, protocol::UtcTime> text_sent_;
};

}  // namespace abbe::mtconnect
