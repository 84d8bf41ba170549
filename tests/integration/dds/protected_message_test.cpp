/// What the message filter does with authentication and with signed messages.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "abbe/subscriber/internal/fragment_reassembly.hpp"
#include "abbe/subscriber/message_filter.hpp"
#include "filter_messages.hpp"

namespace abbe::dds {
namespace {

using namespace test_messages;

struct FragmentsOfAuthentication : testing::Test {
  /// The message that `fragment` completes.
  std::optional<Bytes> completed_by(Bytes fragment) {
    Reassembly reassembly{fragments, {}};
    EXPECT_EQ(filter_message(fragment, Protection::Messages, nullptr, &reassembly),
              fragment.size());
    EXPECT_EQ(fragment[kKindAt], 0x7f) << "not passed as a fragment";
    EXPECT_LE(reassembly.messages.size(), 1u);
    if (reassembly.messages.empty()) return std::nullopt;
    return reassembly.messages.front();
  }
  FragmentReassembly fragments;
};

TEST_F(FragmentsOfAuthentication, AreReassembled) {
  Bytes sample(140);
  for (std::size_t i = 0; i < sample.size(); ++i) sample[i] = static_cast<std::uint8_t>(i);
  const auto part = [&](std::ptrdiff_t from, std::ptrdiff_t to) {
    return Bytes(sample.begin() + from, sample.begin() + to);
  };
  const auto fragment = [&](std::uint8_t first, std::uint8_t count, std::uint8_t size,
                            const Bytes& payload) {
    return fragment_message(kAuthentication, first, count, size, payload);
  };
  EXPECT_FALSE(completed_by(fragment(3, 1, 140, part(128, 140))));
  EXPECT_FALSE(completed_by(fragment(3, 1, 140, part(128, 140))));
  EXPECT_FALSE(completed_by(fragment(2, 1, 140, part(64, 70)))) << "too short";
  EXPECT_FALSE(completed_by(fragment(1, 1, 141, part(0, 64)))) << "of another sample";
  Bytes expected = data_message(0, 5, 16, sample);
  std::copy(kAuthentication.begin(), kAuthentication.end(), &expected[kBodyAt + 8]);
  EXPECT_EQ(completed_by(fragment(1, 2, 140, part(0, 128))), expected);
}

TEST_F(FragmentsOfAuthentication, AreKeptOfAFewSamples) {
  const auto part = [](std::size_t sample, std::uint8_t first) {
    Bytes message = fragment_message(kAuthentication, first, 1, 192, Bytes(64));
    message[kBodyAt + 16] = static_cast<std::uint8_t>(sample);  // sequence number
    return message;
  };
  for (std::size_t i = 0; i <= FragmentReassembly::kMostSamples; ++i)
    for (const std::uint8_t first : {std::uint8_t{1}, std::uint8_t{3}})
      EXPECT_FALSE(completed_by(part(i, first)));
  for (std::size_t i = FragmentReassembly::kMostSamples; i > 0; --i)
    EXPECT_TRUE(completed_by(part(i, 2))) << i;
  EXPECT_FALSE(completed_by(part(0, 2))) << "the oldest was discarded";
}

/// Submessages as in a message with DDS Security.
Bytes message_of(const std::vector<Bytes>& submessages) {
  const Bytes sample = users_data(3, kDisposed);
  Bytes message(sample.begin(), sample.begin() + kKindAt);
  for (const Bytes& submessage : submessages)
    message.insert(message.end(), submessage.begin(), submessage.end());
  return message;
}
Bytes submessage(std::uint8_t kind, const Bytes& body) {
  Bytes bytes{kind, 1, static_cast<std::uint8_t>(body.size()), 0};
  bytes.insert(bytes.end(), body.begin(), body.end());
  return bytes;
}
Bytes disposal() {
  const Bytes sample = users_data(3, kDisposed);
  return {sample.begin() + kKindAt, sample.end()};
}
const Bytes kMessagePrefix = submessage(0x33, Bytes(20)),
            kMessagePostfix = submessage(0x34, Bytes(20)), kPrefix = submessage(0x31, Bytes(20)),
            kPostfix = submessage(0x32, Bytes(20));

std::size_t passed(Bytes message, Protection protection) {
  return filter_message(message, protection);
}

/// A change would break the signature. Without DDS Security the prefix means nothing.
TEST(MessageFilterWithSecurity, DoesNotChangeWhatIsSignedIfTheParticipantIsSecured) {
  for (const Bytes& signed_message : {message_of({kMessagePrefix, disposal(), kMessagePostfix}),
                                      message_of({kPrefix, disposal(), kPostfix})}) {
    for (const auto protection : {Protection::Profile, Protection::Messages}) {
      Bytes message = signed_message;
      EXPECT_EQ(filter_message(message, protection), message.size());
      EXPECT_EQ(message, signed_message);
    }
    Bytes message = signed_message;
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message[kKindAt + 24], 0x08);
  }
}

/// A stranger can put the prefix of a protected submessage in front of his own.
TEST(MessageFilterWithSecurity, TakesOnlyTheProtectedSubmessageAsSigned) {
  Bytes message = message_of({kPrefix, disposal(), kPostfix, disposal()});
  EXPECT_EQ(filter_message(message, Protection::Profile), message.size());
  EXPECT_EQ(message[kKindAt + 24], 0x15) << "signed";
  EXPECT_EQ(message[kKindAt + 48 + disposal().size()], 0x08) << "not signed";
}

/// Fast DDS drops a message at a signed submessage whose key it does not have. The last message of
/// authentication, which gives the key, may be behind one of Cyclone DDS.
TEST(MessageFilterWithSecurity, PassesAuthenticationBehindASignedSubmessageAlone) {
  Bytes payload{0, 1, 0, 0};
  payload.resize(204);
  payload[4 + 96] = 1;  // length of an empty class with its NUL; no tokens
  Bytes alone = data_message(0, 5, 16, payload);
  std::copy(kAuthentication.begin(), kAuthentication.end(), &alone[kBodyAt + 8]);
  const Bytes authentication(alone.begin() + kKindAt, alone.end());

  const auto filtered = [](Bytes& message) {
    FragmentReassembly fragments;
    Reassembly reassembly{fragments, {}};
    EXPECT_EQ(filter_message(message, Protection::Messages, nullptr, &reassembly), message.size());
    return reassembly.messages;
  };
  Bytes behind = message_of({kPrefix, disposal(), kPostfix, authentication});
  EXPECT_EQ(filtered(behind), std::vector<Bytes>({alone}));
  EXPECT_EQ(behind[behind.size() - authentication.size()], 0x7f);

  for (const Bytes& first : {alone, message_of({authentication, kPrefix, disposal(), kPostfix})}) {
    Bytes message = first;
    EXPECT_EQ(filtered(message), std::vector<Bytes>{});
    EXPECT_EQ(message, first);
  }
}

/// Fast DDS computes with the stated lengths before it checks a signature.
TEST(MessageFilterWithSecurity, DropsAnotherStructureThanThatOfDdsSecurity) {
  const Bytes body = submessage(0x30, {0, 0, 0, 4, 1, 2, 3, 4});
  const std::vector<Bytes> right{
      message_of({kPrefix, body, kPostfix}),
      message_of({kMessagePrefix, kPrefix, body, kPostfix, disposal(), kMessagePostfix}),
      message_of({kMessagePrefix, body, kMessagePostfix})};
  for (const Bytes& message : right)
    EXPECT_EQ(passed(message, Protection::Messages), message.size());

  Bytes open = disposal(), with_macs = submessage(0x32, Bytes(20));
  open[2] = open[3] = 0;
  with_macs[4 + 19] = 1;  // states one more MAC than it has
  const Bytes long_body = submessage(0x30, {0xff, 0xff, 0xff, 0xff, 1, 2, 3, 4});
  for (const Bytes& message :
       {message_of({kMessagePrefix, disposal()}), message_of({kMessagePrefix, open}),
        message_of({disposal(), kMessagePrefix, disposal(), kMessagePostfix}),
        message_of({kMessagePrefix, disposal(), kMessagePostfix, disposal()}),
        message_of({disposal(), kMessagePostfix}), message_of({kPrefix, body}),
        message_of({kPrefix, open}), message_of({kPrefix, kPostfix}),
        message_of({kPrefix, body, body, kPostfix}), message_of({kPrefix, long_body, kPostfix}),
        message_of({kPrefix, body, with_macs}), message_of({body}), message_of({kPostfix}),
        message_of({submessage(0x31, Bytes(16)), body, kPostfix})})
    for (const auto protection : {Protection::Profile, Protection::Messages})
      EXPECT_EQ(passed(message, protection), 0u) << testing::PrintToString(message);
}

/// Fast DDS 2.9 takes unsigned samples and heartbeats as those of the participant that they state.
TEST(MessageFilterWithSecurity, SkipsUnsignedOnesWhereEveryMessageIsSigned) {
  const Bytes sample = users_data(5, {0, 1, 0, 0, 1, 2, 3, 4});
  for (Bytes message : {sample, gap_message(5, 6), announcement(kPublications, {kDurability})}) {
    const std::uint8_t kind = message[kKindAt];
    EXPECT_EQ(filter_message(message, Protection::Profile), message.size());
    EXPECT_EQ(message[kKindAt], kind);
    EXPECT_EQ(filter_message(message, Protection::Messages), message.size());
    EXPECT_EQ(message[kKindAt], 0x7f);
  }
}

}  // namespace
}  // namespace abbe::dds
