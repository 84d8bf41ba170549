#pragma once
/// Writes RTPS messages, octet by octet, little endian [DDSI-RTPS 2.5, 9.4]. Only what a test needs
/// to be discovered and to send what no library would.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace abbe::test {

using Prefix = std::array<std::uint8_t, 12>;  ///< of the GUIDs of a participant

inline constexpr std::uint32_t kParticipantWriter = 0x000100c2, kPublicationsWriter = 0x000003c2,
                               kSubscriptionsWriter = 0x000004c2;

class RtpsMessage {
 public:
  using Bytes = std::vector<std::uint8_t>;

  explicit RtpsMessage(const Prefix& from, std::uint8_t vendor = 0x0f) : from_(from) {
    append({'R', 'T', 'P', 'S', 2, 3, 1, vendor});
    append({from.begin(), from.end()});
  }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

  RtpsMessage& append(const Bytes& more) {
    bytes_.insert(bytes_.end(), more.begin(), more.end());
    return *this;
  }
  RtpsMessage& u16(std::uint16_t v) {
    return append({static_cast<std::uint8_t>(v & 0xff), static_cast<std::uint8_t>(v >> 8)});
  }
  RtpsMessage& u32(std::uint32_t v) {
    return u16(static_cast<std::uint16_t>(v & 0xffff)).u16(static_cast<std::uint16_t>(v >> 16));
  }
  RtpsMessage& entity(std::uint32_t id) {  // always big endian
    for (int shift = 24; shift >= 0; shift -= 8)
      bytes_.push_back(static_cast<std::uint8_t>(id >> shift & 0xff));
    return *this;
  }
  RtpsMessage& number(std::int64_t n) {  // high word first
    const auto bits = static_cast<std::uint64_t>(n);
    return u32(static_cast<std::uint32_t>(bits >> 32)).u32(static_cast<std::uint32_t>(bits));
  }

  /// A submessage: its length is filled in by end().
  RtpsMessage& begin(std::uint8_t kind, std::uint8_t flags) {
    append({kind, static_cast<std::uint8_t>(flags | 1u), 0, 0});
    body_ = bytes_.size();
    return *this;
  }
  RtpsMessage& end() {
    while ((bytes_.size() - body_) % 4 != 0) bytes_.push_back(0);
    const std::size_t length = bytes_.size() - body_;
    bytes_[body_ - 2] = static_cast<std::uint8_t>(length & 0xff);
    bytes_[body_ - 1] = static_cast<std::uint8_t>(length >> 8 & 0xff);
    return *this;
  }

  RtpsMessage& parameter(std::uint16_t id, const Bytes& value) {
    u16(id).u16(static_cast<std::uint16_t>((value.size() + 3) / 4 * 4)).append(value);
    for (std::size_t n = value.size(); n % 4 != 0; ++n) bytes_.push_back(0);
    return *this;
  }
  RtpsMessage& end_of_parameters() { return u16(1).u16(0); }

  RtpsMessage& timestamp(std::uint32_t seconds) { return begin(0x09, 0).u32(seconds).u32(0).end(); }
  RtpsMessage& heartbeat(std::uint32_t writer, std::int64_t first, std::int64_t last,
                         std::uint32_t count) {
    begin(0x07, 0).entity(0).entity(writer).number(first).number(last);
    return u32(count).end();
  }
  RtpsMessage& data(std::uint32_t writer, std::int64_t n, std::uint8_t flags = 4) {
    return begin(0x15, flags).u16(0).u16(16).entity(0).entity(writer).number(n);
  }

  /// Announces the participant, whose port on this computer is `port`. `token`: class of its tokens
  /// of identity and permissions; empty: none.
  RtpsMessage& participant(std::int64_t n, std::uint16_t port, const Bytes& user_data = {},
                           const std::string& token = {}) {
    data(kParticipantWriter, n).append({0, 3, 0, 0});
    parameter(0x0015, {2, 3, 0, 0}).parameter(0x0016, {1, 15, 0, 0});
    parameter(0x0050, guid(0x000001c1));
    for (const std::uint16_t id : {std::uint16_t{0x0032}, std::uint16_t{0x0031}})
      parameter(id, locator(port));
    parameter(0x0002, {20, 0, 0, 0, 0, 0, 0, 0});  // lease
    parameter(0x0058, {0x3f, 0x0c, 0xc0, 0});  // builtin endpoints, those of authentication, too
    if (!user_data.empty()) parameter(0x002c, counted(user_data));
    for (const std::uint16_t id : {std::uint16_t{0x1001}, std::uint16_t{0x1002}}) {
      Bytes value = text(token);
      value.resize((value.size() + 3) / 4 * 4 + 8);  // neither properties nor binary ones
      if (!token.empty()) parameter(id, value);
    }
    return end_of_parameters().end();
  }
  RtpsMessage& withdrawn_participant(std::int64_t n) {
    data(kParticipantWriter, n, 2 | 8).parameter(0x0071, {0, 0, 0, 3}).end_of_parameters();
    append({0, 3, 0, 0}).parameter(0x0050, guid(0x000001c1));
    return end_of_parameters().end();
  }

  /// Announces a writer or reader with the QoS of abbe's.
  RtpsMessage& endpoint(bool writer, std::int64_t n, std::uint32_t entity, const std::string& topic,
                        const std::string& type, bool durable, bool manual_liveliness) {
    data(writer ? kPublicationsWriter : kSubscriptionsWriter, n).append({0, 3, 0, 0});
    parameter(0x0015, {2, 3, 0, 0}).parameter(0x0016, {1, 15, 0, 0});
    parameter(0x005a, guid(entity)).parameter(0x0070, guid(entity));
    parameter(0x0050, guid(0x000001c1));
    parameter(0x0005, text(topic)).parameter(0x0007, text(type));
    const auto kind = static_cast<std::uint8_t>(durable ? 2 : 1);
    parameter(0x001a, {kind, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
    parameter(0x001d, {static_cast<std::uint8_t>(durable ? 1 : 0), 0, 0, 0});
    if (manual_liveliness) parameter(0x001b, {2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0});
    return end_of_parameters().end();
  }

 private:
  [[nodiscard]] Bytes guid(std::uint32_t entity) const {
    Bytes bytes(from_.begin(), from_.end());
    for (int shift = 24; shift >= 0; shift -= 8)
      bytes.push_back(static_cast<std::uint8_t>(entity >> shift & 0xff));
    return bytes;
  }
  static Bytes counted(const Bytes& value) {
    Bytes bytes{static_cast<std::uint8_t>(value.size()),
                static_cast<std::uint8_t>(value.size() >> 8), 0, 0};
    bytes.insert(bytes.end(), value.begin(), value.end());
    return bytes;
  }
  static Bytes text(const std::string& text) {
    Bytes value(text.begin(), text.end());
    value.push_back(0);
    return counted(value);
  }
  static Bytes locator(std::uint16_t port) {
    Bytes bytes{
        1, 0, 0, 0, static_cast<std::uint8_t>(port & 0xff), static_cast<std::uint8_t>(port >> 8),
        0, 0};
    bytes.resize(20);
    bytes.insert(bytes.end(), {127, 0, 0, 1});
    return bytes;
  }

  Prefix from_;
  Bytes bytes_;
  std::size_t body_ = 0;
};

}  // namespace abbe::test
