// A participant without keys that is discovered and matched as any other one, and then sends valid
// RTPS in random order, for the tests and `scripts/soak hostile`:
//   dds_hostile_peer DOMAIN SEED            everything
//   dds_hostile_peer DOMAIN SEED dispose    only samples that dispose or unregister an instance,
//                                           with and without key
//   dds_hostile_peer DOMAIN SEED numbers    only gaps of numbers far apart, and heartbeats
//                                           that skip a million million numbers
//   dds_hostile_peer DOMAIN SEED tokens     only messages of authentication, whole and
//                                           in fragments, that state four thousand
//                                           million tokens
//   dds_hostile_peer DOMAIN SEED forged     only vectors of 999 um, unsigned, with the GUIDs of the
//                                           writers that the other participants may have
//   dds_hostile_peer DOMAIN SEED claims     80 participants, each with the Identity of a machine of
//                                           its own, every second
// It announces writers and readers of all topics of abbe under changing GUIDs, and sends DATA,
// DATA_FRAG, HEARTBEAT, GAP, ACKNACK and all other submessages of the standard with random content
// to the participants 0 to 15 of the domain on this computer. Except with `forged`, it uses no GUID
// of another participant. It runs until it is killed, prints "started" when it begins to send, and
// "sent N" every 200 messages.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "abbe/messages/topics.hpp"
#include "rtps_message.hpp"
#include "sample_messages.hpp"

namespace {

using namespace abbe;
using test::Prefix;
using test::RtpsMessage;
using Bytes = std::vector<std::uint8_t>;

constexpr int kMostParticipants = 16;

class HostilePeer {
 public:
  HostilePeer(int domain, unsigned seed, std::string mode)
      : domain_(domain), mode_(std::move(mode)), random_(seed) {
    fd_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof own;
    if (fd_ < 0 || ::bind(fd_, reinterpret_cast<sockaddr*>(&own), size) != 0 ||
        ::getsockname(fd_, reinterpret_cast<sockaddr*>(&own), &size) != 0)
      std::exit(4);
    port_ = ::ntohs(own.sin_port);
  }

  /// One participant: announced, heard for a while, withdrawn.
  void live_once() {
    for (auto& octet : prefix_) octet = any8();
    spdp_number_ = sedp_number_ = 0;
    numbers_.fill(0);
    for (int i = 0; i < 2; ++i) announce_participant();
    for (int i = 0; i < 2; ++i) announce_endpoints();
    if (mode_.empty()) send_valid_samples();

    for (int i = 0; i < 2000; ++i) {
      send(hostile_message());
      if (i % 500 == 250) announce_participant();
      if (i % 200 == 199) std::printf("sent %llu\n", static_cast<unsigned long long>(sent_));
      if (i % 20 == 0) std::this_thread::sleep_for(std::chrono::milliseconds{4});
      learn();
    }
    withdraw();
  }

  void claim_identities() {
    constexpr std::uint8_t kClaims = 80;
    constexpr auto kTopic = static_cast<std::size_t>(daemon::Topic::Identity);
    const auto& traits = daemon::traits(daemon::Topic::Identity);
    ++claimed_;
    for (std::uint8_t i = 1; i <= kClaims; ++i) {
      prefix_.fill(i);
      RtpsMessage participant(prefix_), writer(prefix_), sample(prefix_);
      participant.participant(claimed_, port_);
      to_every_port(participant.bytes(), 0);
      writer.endpoint(true, 1, entity(kTopic, true), std::string(traits.name),
                      std::string(traits.type_name), true, false);
      writer.heartbeat(test::kPublicationsWriter, 1, 1, ++count_);
      to_every_port(writer.bytes(), 0);
      auto identity = test::identity(static_cast<std::uint64_t>(claimed_));
      identity.machine("claimed-" + std::to_string(i));
      identity.machine_id("claimed-" + std::to_string(i));
      sample.data(entity(kTopic, true), claimed_).append(bytes_of(identity)).end();
      sample.heartbeat(entity(kTopic, true), claimed_, claimed_, ++count_);
      to_every_port(sample.bytes(), 1);
    }
    std::printf("claimed %lld\n", static_cast<long long>(claimed_));
    std::this_thread::sleep_for(std::chrono::milliseconds{500});
  }

 private:
  // ---- random numbers ----
  std::uint32_t any() { return static_cast<std::uint32_t>(random_()); }
  std::uint8_t any8() { return static_cast<std::uint8_t>(random_()); }
  unsigned below(std::size_t bound) { return any() % static_cast<unsigned>(bound); }
  bool chance(unsigned one_in) { return below(one_in) == 0; }
  template <class T, std::size_t N>
  T one_of(const std::array<T, N>& values) {
    return values[below(N)];
  }
  Bytes garbage(std::size_t bound) {
    Bytes bytes(below(bound) / 4 * 4);
    for (auto& b : bytes) b = any8();
    return bytes;
  }
  /// Of a machine of its own, while the participant is discovered: a reader that is matched
  /// delivers them. Later a number near the largest keeps it from the smaller ones.
  void send_valid_samples() {
    constexpr auto kIdentity = static_cast<std::size_t>(daemon::Topic::Identity),
                   kSnapshot = static_cast<std::size_t>(daemon::Topic::Snapshot);
    const std::string name = "hostile-" + std::to_string(below(200));
    for (int i = 0; i < 50; ++i) {
      RtpsMessage m(prefix_);
      auto identity = test::identity(any());
      identity.machine(name);
      identity.machine_id(name);
      const std::int64_t n = ++numbers_[kIdentity];
      m.data(entity(kIdentity, true), n).append(bytes_of(identity)).end();
      m.heartbeat(entity(kIdentity, true), n, n, ++count_);
      auto snapshot = test::snapshot(any());
      snapshot.machine(name);
      m.data(entity(kSnapshot, true), ++numbers_[kSnapshot]).append(bytes_of(snapshot)).end();
      to_every_port(m.bytes(), 1);
      std::this_thread::sleep_for(std::chrono::milliseconds{4});
    }
  }
  /// Most of the time the next number of the writer, so that its samples are delivered.
  std::int64_t number_of(std::size_t writer) {
    if (chance(6))
      return one_of(std::array<std::int64_t, 7>{0, -1, 1, INT64_MAX, INT64_MAX - 1,
                                                std::int64_t{1} << 62, std::int64_t{any()}});
    numbers_[writer] += chance(8) ? 2 : 1;
    return numbers_[writer];
  }

  // ---- discovery ----
  void announce_participant() {
    RtpsMessage m(prefix_);
    m.participant(++spdp_number_, port_, chance(4) ? garbage(120) : Bytes{},
                  mode_ == "tokens" ? "DDS:Auth:PKI-DH:1.0" : "");
    to_every_port(m.bytes(), 0);
  }
  void announce_endpoints() {
    for (std::size_t i = 0; i < daemon::kTopicCount; ++i) {
      for (const bool writer : {true, false}) {
        const auto& traits = daemon::all_topics()[i];
        RtpsMessage m(prefix_);
        m.endpoint(writer, static_cast<std::int64_t>(i + 1), entity(i, writer),
                   std::string(traits.name), std::string(traits.type_name),
                   traits.kind == daemon::TopicTraits::Kind::Durable,
                   traits.topic == daemon::Topic::ModelState);
        m.heartbeat(writer ? test::kPublicationsWriter : test::kSubscriptionsWriter, 1,
                    static_cast<std::int64_t>(daemon::kTopicCount), ++count_);
        to_every_port(m.bytes(), 0);
      }
    }
  }
  void withdraw() {
    RtpsMessage m(prefix_);
    m.withdrawn_participant(++spdp_number_);
    to_every_port(m.bytes(), 0);
  }
  static std::uint32_t entity(std::size_t topic, bool writer) {
    return static_cast<std::uint32_t>(0x100 * (topic + 1)) | (writer ? 0x02u : 0x07u);
  }

  // ---- content ----
  std::string machine() {
    return chance(3) ? test::kMachine : "hostile-" + std::to_string(below(200));
  }
  template <class T>
  Bytes encoded(T value) {
    value.machine(machine());
    return bytes_of(value);
  }
  template <class T>
  static Bytes bytes_of(const T& value) {
    std::vector<std::byte> payload;
    if (!daemon::encode(value, payload)) return {};
    const auto* begin = reinterpret_cast<const std::uint8_t*>(payload.data());
    return {begin, begin + payload.size()};
  }
  Bytes valid_payload(std::size_t topic) {
    switch (static_cast<daemon::Topic>(topic)) {
      case daemon::Topic::Snapshot:
        return encoded(test::snapshot(any()));
      case daemon::Topic::Compensation:
        return encoded(test::compensation(any()));
      case daemon::Topic::ErrorModel:
        return encoded(test::error_model());
      case daemon::Topic::ErrorGrid:
        return encoded(test::grid_slices()[below(2)]);
      case daemon::Topic::ModelState:
        return encoded(test::active_state(any()));
      case daemon::Topic::Identity:
        return encoded(test::identity(any()));
      case daemon::Topic::Health:
        return encoded(v1::Health{});
      case daemon::Topic::CalibrationEvent:
        return encoded(v1::CalibrationEvent{});
    }
    return {};
  }
  Bytes payload(std::size_t topic) {
    Bytes bytes = chance(8) ? garbage(400) : valid_payload(topic);
    if (bytes.empty()) return bytes;
    if (chance(6)) bytes[1] = static_cast<std::uint8_t>(below(12));  // another encapsulation
    if (chance(6)) bytes.resize(below(bytes.size()) / 4 * 4);
    for (unsigned n = chance(4) ? below(6) : 0; n > 0 && !bytes.empty(); --n)
      bytes[below(bytes.size())] = any8();
    return bytes;
  }
  void parameters(RtpsMessage& m) {
    for (unsigned n = below(4); n > 0; --n) {
      const auto id = one_of(std::array<std::uint16_t, 12>{
          0x0070, 0x0071, 0x0056, 0x0061, 0x0083, 0x0055, 0x0005, 0x001b, 0x002c, 0x4001, 0x8007,
          static_cast<std::uint16_t>(any())});
      m.parameter(id, id == 0x0070 ? Bytes(16, any8()) : garbage(chance(4) ? 80 : 28));
    }
    if (chance(3)) m.parameter(0x0071, {0, 0, 0, static_cast<std::uint8_t>(below(5))});
    if (!chance(40)) m.end_of_parameters();
  }

  // ---- submessages ----
  void data(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    const bool with_qos = chance(2);
    const unsigned content = below(8);  // mostly data
    const auto flags = static_cast<std::uint8_t>((with_qos ? 2u : 0u) | (content == 0   ? 0u
                                                                         : content == 1 ? 8u
                                                                         : content == 2 ? 12u
                                                                                        : 4u));
    m.begin(0x15, flags);
    m.u16(0).u16(chance(30) ? static_cast<std::uint16_t>(any()) : 16);
    m.entity(chance(2) ? 0 : entity(topic, false)).entity(entity(topic, true));
    m.number(number_of(topic));
    if (with_qos) parameters(m);
    if (content == 1) m.append(chance(2) ? garbage(40) : valid_payload(topic));
    if (content > 1) m.append(payload(topic));
    m.end();
  }
  void dispose(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    const bool with_key = chance(2);
    m.begin(0x15, static_cast<std::uint8_t>(2u | (with_key ? 8u : 0u)));
    m.u16(0).u16(16).entity(0).entity(entity(topic, true)).number(number_of(topic));
    if (chance(2)) m.parameter(0x0070, Bytes(16, any8()));
    m.parameter(0x0071, {0, 0, 0, static_cast<std::uint8_t>(1 + below(3))}).end_of_parameters();
    if (with_key) m.append(valid_payload(topic));
    m.end();
  }
  void fragment(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    const Bytes whole = valid_payload(topic);
    if (whole.empty()) return;
    const auto size = static_cast<std::uint16_t>(chance(6) ? any() : 64 + below(512));
    const auto first = chance(6) ? any() : 1 + below(whole.size() / 64 + 1);
    const auto count = static_cast<std::uint16_t>(chance(6) ? any() : 1);
    const std::size_t from = std::min(whole.size(), std::size_t{first - 1} * size);
    const std::size_t bytes = std::min<std::size_t>(whole.size() - from, size);
    const bool with_qos = chance(2);
    m.begin(0x16, static_cast<std::uint8_t>((with_qos ? 2u : 0u) | (chance(8) ? 4u : 0u)));
    m.u16(0).u16(28).entity(0);
    m.entity(chance(4) ? one_of(kBuiltinWriters) : entity(topic, true));
    m.number(number_of(topic)).u32(first).u16(count).u16(size);
    m.u32(chance(6) ? any() : static_cast<std::uint32_t>(whole.size()));
    if (with_qos) parameters(m);
    m.append({whole.begin() + static_cast<std::ptrdiff_t>(from),
              whole.begin() + static_cast<std::ptrdiff_t>(from + bytes)});
    m.end();
  }
  void number_set(RtpsMessage& m, std::int64_t base) {
    const unsigned bits = chance(4) ? any() : below(257);
    m.number(base).u32(bits);
    for (unsigned i = 0; i < std::min(8u, (bits + 31) / 32); ++i) m.u32(any());
  }
  void heartbeat(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    const std::int64_t first = chance(4) ? number_of(topic) : 1;
    const std::int64_t last = chance(4) ? number_of(topic) : numbers_[topic];
    m.begin(0x07, static_cast<std::uint8_t>(2 * below(4)));
    m.entity(0).entity(chance(6) ? one_of(kBuiltinWriters) : entity(topic, true));
    m.number(first).number(last).u32(chance(8) ? any() : ++count_).end();
  }
  void gap(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    const std::int64_t start = chance(4) ? number_of(topic) : numbers_[topic] + 1;
    m.begin(0x08, 0);
    m.entity(0).entity(chance(6) ? one_of(kBuiltinWriters) : entity(topic, true)).number(start);
    number_set(m, chance(4) ? number_of(topic) : numbers_[topic] + 2 + below(100));
    m.end();
  }
  void acknack(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    m.begin(0x06, static_cast<std::uint8_t>(2 * below(2)));
    m.entity(chance(6) ? 0x000003c7u : entity(topic, false)).entity(known_entity());
    number_set(m, chance(3) ? number_of(topic) : below(50));
    m.u32(++count_).end();
  }
  void nack_fragments(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    m.begin(0x12, 0).entity(entity(topic, false)).entity(known_entity());
    m.number(below(50)).u32(chance(3) ? any() : 1);
    const unsigned bits = chance(4) ? any() : below(257);
    m.u32(bits);
    for (unsigned i = 0; i < std::min(8u, (bits + 31) / 32); ++i) m.u32(any());
    m.u32(++count_).end();
  }
  void heartbeat_fragments(RtpsMessage& m) {
    const std::size_t topic = below(daemon::kTopicCount);
    m.begin(0x13, 0).entity(0).entity(entity(topic, true)).number(number_of(topic));
    m.u32(any()).u32(++count_).end();
  }
  void information(RtpsMessage& m) {
    switch (below(5)) {
      case 0:
        m.timestamp(one_of(std::array<std::uint32_t, 4>{0, 0x7fffffff, 0xffffffff, any()}));
        break;
      case 1: {
        m.begin(0x0e, 0);
        const Prefix to = known_prefix();
        m.append({to.begin(), to.end()}).end();
        break;
      }
      case 2:
        m.begin(0x0c, 0).append({0, 0, 0, 0, 2, 3, 1, 15}).append({prefix_.begin(), prefix_.end()});
        m.end();
        break;
      case 3:
        m.begin(one_of(std::array<std::uint8_t, 2>{0x0d, 0x0f}),
                static_cast<std::uint8_t>(2 * below(2)));
        m.append(garbage(80)).end();
        break;
      default:
        m.begin(one_of(std::array<std::uint8_t, 5>{0x01, 0x02, 0x30, 0x31, 0x7e}),
                static_cast<std::uint8_t>(any8() & 0xfeu));
        m.append(garbage(60)).end();
    }
  }
  /// Discovery with random parameters; also withdrawals of endpoints.
  void discovery(RtpsMessage& m) {
    const std::uint32_t writer = one_of(kBuiltinWriters);
    const bool with_qos = chance(3);
    const bool key_only = chance(6);
    m.begin(0x15, static_cast<std::uint8_t>((with_qos ? 2u : 0u) | (key_only ? 8u : 4u)));
    m.u16(0).u16(16).entity(0).entity(writer);
    m.number(chance(4) ? number_of(0) : 100 + ++sedp_number_);
    if (with_qos) parameters(m);
    m.append({0, static_cast<std::uint8_t>(chance(8) ? any8() : 3), 0, 0});
    if (chance(2)) m.parameter(0x0050, guid(0x000001c1));
    if (chance(2)) m.parameter(0x005a, guid(entity(below(daemon::kTopicCount), chance(2))));
    for (unsigned n = below(10); n > 0; --n) discovery_parameter(m);
    if (!chance(30)) m.end_of_parameters();
    m.end();
  }
  void discovery_parameter(RtpsMessage& m) {
    constexpr std::array<std::uint16_t, 36> kIds{
        0x0002, 0x0004, 0x0005, 0x0006, 0x0007, 0x000b, 0x000d, 0x000f, 0x0015,
        0x0016, 0x001a, 0x001b, 0x001d, 0x001e, 0x0023, 0x0025, 0x0029, 0x002c,
        0x002d, 0x002e, 0x002f, 0x0031, 0x0032, 0x0035, 0x0040, 0x0041, 0x0043,
        0x0049, 0x0058, 0x0059, 0x0062, 0x0073, 0x0074, 0x1001, 0x1002, 0x8006};
    const auto id = chance(6) ? static_cast<std::uint16_t>(any()) : one_of(kIds);
    Bytes value = garbage(chance(6) ? 300 : 40);
    if (chance(2) && value.size() >= 4) {  // begins with a length, a kind, a count
      value[0] = static_cast<std::uint8_t>(below(24));
      value[1] = value[2] = value[3] = 0;
      if (chance(4)) value[1] = value[2] = value[3] = any8();  // more than the value has
    }
    m.parameter(id, value);
  }
  void liveliness(RtpsMessage& m) {
    m.begin(0x15, chance(2) ? 4 : 8);
    m.u16(0).u16(16).entity(0).entity(0x000200c2).number(++sedp_number_);
    m.append({0, 1, 0, 0}).append({prefix_.begin(), prefix_.end()});
    m.append({0, 0, 0, static_cast<std::uint8_t>(below(4))}).append(garbage(40)).end();
  }

  /// Each number of a gap that is not the next one is kept by a reader.
  Bytes numbers_message() {
    constexpr std::int64_t kLength = 1000;
    RtpsMessage m(prefix_);
    for (int n = 0; n < 30; ++n) {
      const std::int64_t start = 2 + std::int64_t{below(1'000'000'000)};
      m.begin(0x08, 0).entity(0).entity(entity(below(daemon::kTopicCount), true));
      m.number(start).number(start + kLength).u32(0).end();
    }
    constexpr std::int64_t kFar = std::int64_t{1} << 40;
    if (chance(200)) m.heartbeat(entity(below(daemon::kTopicCount), true), kFar, kFar, ++count_);
    return m.bytes();
  }
  /// A whole message of authentication, or its two fragments.
  Bytes tokens_message() {
    constexpr std::uint32_t kAuthenticationWriter = 0x000201c3;
    constexpr std::uint16_t kFragment = 64;
    RtpsMessage content({});
    content.append({0, 1, 0, 0}).append(Bytes(96, any8()));
    content.u32(4).append({'d', 'd', 's', 0}).u32(0xffff'ffff).append(Bytes(20, any8()));
    const Bytes sample(content.bytes().begin() + 20, content.bytes().end());
    const std::int64_t number = ++sedp_number_;
    RtpsMessage m(prefix_);
    if (chance(2)) {
      m.data(kAuthenticationWriter, number).append(sample).end();
      return m.bytes();
    }
    for (std::uint32_t first = 1; (first - 1) * kFragment < sample.size(); ++first) {
      const auto from = sample.begin() + (first - 1) * kFragment;
      const auto end = sample.begin() + std::min<std::ptrdiff_t>(first * kFragment, sample.size());
      m.begin(0x16, 0).u16(0).u16(28).entity(0).entity(kAuthenticationWriter).number(number);
      m.u32(first).u16(1).u16(kFragment).u32(static_cast<std::uint32_t>(sample.size()));
      m.append({from, end}).end();
    }
    return m.bytes();
  }
  /// A vector as of the writer `number` of another participant.
  Bytes forged_message(std::uint32_t number) {
    RtpsMessage m(known_prefix());
    auto vector = test::compensation(static_cast<std::uint64_t>(1'000'000 + sedp_number_));
    vector.vector_m({999e-6, 999e-6, 999e-6});
    m.data(0x100 * number | 0x02, 1'000'000 + ++sedp_number_).append(bytes_of(vector)).end();
    return m.bytes();
  }
  Bytes hostile_message() {
    if (mode_ == "forged") return forged_message(1 + below(12));
    if (mode_ == "numbers") return numbers_message();
    if (mode_ == "tokens") return tokens_message();
    RtpsMessage m(prefix_, chance(2) ? 0x0f : 0x10);
    for (unsigned n = 1 + below(4); n > 0; --n) {
      switch (mode_ == "dispose" ? 0 : below(16)) {
        case 0:
        case 1:
          dispose(m);
          break;
        case 2:
        case 3:
          fragment(m);
          break;
        case 4:
        case 5:
          heartbeat(m);
          break;
        case 6:
          gap(m);
          break;
        case 7:
          acknack(m);
          break;
        case 8:
          nack_fragments(m);
          break;
        case 9:
          heartbeat_fragments(m);
          break;
        case 10:
          information(m);
          break;
        case 11:
          discovery(m);
          break;
        case 12:
          liveliness(m);
          break;
        default:
          data(m);
      }
    }
    return m.bytes();
  }

  // ---- what others sent ----
  void learn() {
    std::array<std::uint8_t, 65536> datagram{};
    for (int i = 0; i < 8; ++i) {
      const ssize_t n = ::recv(fd_, datagram.data(), datagram.size(), MSG_DONTWAIT);
      if (n < 20) return;
      Prefix from{};
      std::copy_n(datagram.begin() + 8, from.size(), from.begin());
      if (from != prefix_ && prefixes_.size() < 64) prefixes_.insert(from);
    }
  }
  Prefix known_prefix() {
    if (prefixes_.empty() || chance(4)) return {};
    auto known = prefixes_.begin();
    std::advance(known, below(prefixes_.size()));
    return *known;
  }
  /// A writer that Fast DDS may have: it numbers them.
  std::uint32_t known_entity() {
    return chance(5) ? one_of(kBuiltinWriters) : 0x100u * (1 + below(12)) | 0x02u;
  }
  Bytes guid(std::uint32_t entity) {
    Bytes bytes(prefix_.begin(), prefix_.end());
    for (int shift = 24; shift >= 0; shift -= 8)
      bytes.push_back(static_cast<std::uint8_t>(entity >> shift & 0xff));
    return bytes;
  }

  // ---- sending ----
  void send(const Bytes& message) { to_every_port(message, below(2)); }
  /// Of each participant: its port for discovery (0) or data (1).
  void to_every_port(const Bytes& message, unsigned which) {
    if (message.size() > 65000) return;
    for (int i = 0; i < kMostParticipants; ++i) {
      sockaddr_in to{};
      to.sin_family = AF_INET;
      to.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
      to.sin_port = ::htons(
          static_cast<std::uint16_t>(7400 + 250 * domain_ + 10 + 2 * i + static_cast<int>(which)));
      static_cast<void>(::sendto(fd_, message.data(), message.size(), 0,
                                 reinterpret_cast<const sockaddr*>(&to), sizeof to));
    }
    ++sent_;
  }

  static constexpr std::array<std::uint32_t, 8> kBuiltinWriters{0x000100c2, 0x000003c2, 0x000004c2,
                                                                0x000200c2, 0x000201c3, 0xff0202c3,
                                                                0xff0003c2, 0xff0101c2};

  int domain_, fd_ = -1;
  std::string mode_;
  std::uint16_t port_ = 0;
  std::mt19937 random_;
  Prefix prefix_{};
  std::int64_t spdp_number_ = 0, sedp_number_ = 0;
  std::array<std::int64_t, daemon::kTopicCount> numbers_{};
  std::uint32_t count_ = 0;
  std::int64_t claimed_ = 0;
  std::set<Prefix> prefixes_;
  std::uint64_t sent_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  std::printf("seed %s\nstarted\n", argv[2]);
  HostilePeer peer(std::atoi(argv[1]), static_cast<unsigned>(std::atol(argv[2])),
                   argc > 3 ? argv[3] : "");
  const bool claims = argc > 3 && std::string(argv[3]) == "claims";
  for (;;) {
    if (claims)
      peer.claim_identities();
    else
      peer.live_once();
  }
}
