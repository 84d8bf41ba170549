#include "abbe/mtconnect/shdr_feed.hpp"

#include <fmt/format.h>

#include <string_view>

#include "abbe/mtconnect/shdr_text.hpp"

namespace abbe::mtconnect {
namespace {

constexpr std::string_view kUnavailable = "UNAVAILABLE", kNormal = "NORMAL";

std::string_view name_of(Level level) {
  return level == Level::Fault ? "FAULT" : "WARNING";
}

/// Time and name of the data item: the beginning of each line.
std::string head_of(const std::string& name, protocol::UtcTime now) {
  return fmt::format("{}|{}", shdr_time(now), name);
}

/// A line of a condition: time|name|level|native code|native severity|qualifier|text.
std::string condition_line(std::string_view head, std::string_view level, std::string_view code,
                           std::string_view text) {
  return fmt::format("{}|{}|{}|||{}\n", head, level, shdr_code(code), shdr_field(text));
}

/// The lines of a whole value, independent of what was sent before.
struct WholeValue {
  std::string_view head;

  std::string operator()(const std::optional<std::string>& event) const {
    return fmt::format("{}|{}\n", head, event ? shdr_field(*event) : kUnavailable);
  }
  std::string operator()(const std::optional<Message>& message) const {
    if (!message) return fmt::format("{}||{}\n", head, kUnavailable);
    return fmt::format("{}|{}|{}\n", head, shdr_code(message->code), shdr_field(message->text));
  }
  std::string operator()(const std::optional<Condition>& condition) const {
    if (!condition) return condition_line(head, kUnavailable, "", "");
    if (condition->empty()) return condition_line(head, kNormal, "", "");
    std::string lines;
    for (const auto& [code, raised] : *condition)
      lines += condition_line(head, name_of(raised.level), code, raised.text);
    return lines;
  }
};

/// Lines that first end the conditions that are no longer raised, then raise those that are new or
/// different.
std::string condition_changes(std::string_view head, const Condition& before,
                              const Condition& after) {
  std::string lines;
  for (const auto& [code, raised] : before)
    if (!after.contains(code)) lines += condition_line(head, kNormal, code, "");

  for (const auto& [code, raised] : after) {
    const auto old = before.find(code);
    if (old == before.end() || old->second != raised)
      lines += condition_line(head, name_of(raised.level), code, raised.text);
  }

  return lines;
}

const Condition* raised_in(const Value& value) {
  const auto* condition = std::get_if<std::optional<Condition>>(&value);
  return condition != nullptr && *condition && !(*condition)->empty() ? &**condition : nullptr;
}

/// The lines that change the value from `before` to `after` at a client.
std::string changes(const std::string& name, const Value& before, const Value& after,
                    protocol::UtcTime now) {
  if (before == after) return {};
  const std::string head = head_of(name, now);
  const Condition* old = raised_in(before);
  const Condition* present = raised_in(after);
  return old != nullptr && present != nullptr ? condition_changes(head, *old, *present)
                                              : std::visit(WholeValue{head}, after);
}

}  // namespace

std::string ShdrFeed::update(Observations observed, protocol::UtcTime now) {
  std::string lines;
  for (auto& [name, value] : observed) {
    Value& sent = sent_.at(name);
    keep_recent_texts(name, sent, value, now);
    lines += changes(name, sent, value, now);
    sent = std::move(value);
  }
  return lines;
}

void ShdrFeed::keep_recent_texts(const std::string& name, const Value& sent, Value& value,
                                 protocol::UtcTime now) {
  auto* condition = std::get_if<std::optional<Condition>>(&value);
  if (condition == nullptr || !*condition) return;
  const Condition* const before = raised_in(sent);

  for (auto& [code, raised] : **condition) {
    protocol::UtcTime& text_sent = text_sent_[{name, code}];
    const auto old = before != nullptr ? before->find(code) : Condition::const_iterator{};
    const bool stays =
        before != nullptr && old != before->end() && old->second.level == raised.level;
    // If the clock was set back, the text must not be held back.
    const bool recent = now >= text_sent && now - text_sent < kTextPeriod;
    if (stays && old->second.text != raised.text && recent) raised.text = old->second.text;
    if (!stays || old->second.text != raised.text) text_sent = now;
  }
}

std::string ShdrFeed::everything(protocol::UtcTime now) const {
  std::string lines;
  for (const auto& [name, value] : sent_)
    lines += std::visit(WholeValue{head_of(name, now)}, value);
  return lines;
}

}  // namespace abbe::mtconnect
