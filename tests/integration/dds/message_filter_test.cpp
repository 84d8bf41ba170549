#include "abbe/subscriber/message_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <tuple>
#include <vector>

#include "filter_messages.hpp"

namespace abbe::dds {
namespace {

using namespace test_messages;

struct MessageFilter : testing::TestWithParam<bool> {};

TEST_P(MessageFilter, BlanksTypesAndNothingElse) {
  for (const auto writer : {kPublications, kSubscriptions}) {
    Bytes message = announcement(writer, {kDurability, kTypeObject, kTypeInformation}, GetParam());
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message, announcement(writer, {kDurability, 0xbfff, 0xbfff}, GetParam()));
  }
}

TEST_P(MessageFilter, DoesNotChangeOtherWritersAndOtherParameters) {
  for (const auto& untouched : {announcement(kSomebodys, {kTypeObject}, GetParam()),
                                announcement(kPublications, {kDurability}, GetParam())}) {
    Bytes message = untouched;
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message, untouched);
  }
}

INSTANTIATE_TEST_SUITE_P(BothByteOrders, MessageFilter, testing::Bool());

TEST(MessageFilterInput, ReplacesAnnouncementsInFragmentsByGaps) {
  Bytes message = announcement(kPublications, {kTypeObject}, true, 0x16);
  EXPECT_EQ(filter_message(message), message.size());
  EXPECT_EQ(message[20], 0x08);
}

Bytes with_statistics(std::uint16_t length, std::size_t bytes) {
  Bytes message = announcement(kSomebodys, {kDurability});
  message.insert(message.end(), {0x80, 1, static_cast<std::uint8_t>(length & 0xff),
                                 static_cast<std::uint8_t>(length >> 8)});
  message.resize(message.size() + bytes);
  return message;
}

TEST(MessageFilterInput, CutsStatisticsOffTheEndAndDropsMessagesThatHaveThemElsewhere) {
  const std::size_t before = announcement(kSomebodys, {kDurability}).size();
  for (const std::uint16_t length : {std::uint16_t{8}, std::uint16_t{56}}) {
    Bytes message = with_statistics(length, length);
    EXPECT_EQ(filter_message(message), before);
  }
  Bytes in_the_middle = with_statistics(8, 16);
  EXPECT_EQ(filter_message(in_the_middle), 0u);
}

TEST(MessageFilterInput, DropsWrongLengths) {
  Bytes too_long = with_statistics(400, 8);
  EXPECT_EQ(filter_message(too_long), 0u);
  Bytes odd = announcement(kSomebodys, {kDurability});
  odd[22] = static_cast<std::uint8_t>(odd[22] - 2);
  EXPECT_EQ(filter_message(odd), 0u);
}

/// Fast DDS reads a signed number, and takes what is below 16 for 16.
TEST(MessageFilterInput, DropsAnnouncementsWhoseParametersAreElsewhereForFastDds) {
  const Bytes list{0, 3, 0, 0, 0x72, 0, 4, 0, 1, 2, 3, 4, 1, 0, 0, 0};
  for (const auto to_inline_qos :
       std::array<std::uint16_t, 5>{0x0000, 0x0008, 0x000f, 0x8000, 0xffff}) {
    Bytes message = data_message(kPublications, 5, to_inline_qos, list);
    EXPECT_EQ(filter_message(message), 0u) << to_inline_qos;
  }
  Bytes beyond = data_message(kPublications, 5, 400, list);
  EXPECT_EQ(filter_message(beyond), 0u);
}

/// Fast DDS aligns to four bytes, others do not.
TEST(MessageFilterInput, DropsAnnouncementsWithParametersThatAreNotAligned) {
  for (const auto length : std::array<std::uint8_t, 4>{1, 2, 3, 5}) {
    Bytes list{0, 3, 0, 0, 0x0a, 0x80, length, 0};
    list.resize(list.size() + 4 * ((length + 3u) / 4));
    list.insert(list.end(), {0x72, 0, 4, 0, 1, 2, 3, 4, 1, 0, 0, 0});
    Bytes message = data_message(kPublications, 5, 16, list);
    EXPECT_EQ(filter_message(message), 0u) << int{length};
    list.erase(list.begin(), list.begin() + 4);
    list.insert(list.end(), {0, 3, 0, 0, 0x72, 0, 4, 0, 1, 2, 3, 4, 1, 0, 0, 0});
    Bytes inline_qos = data_message(kPublications, 7, 16, list);
    EXPECT_EQ(filter_message(inline_qos), 0u) << int{length};
  }
}

TEST(MessageFilterInput, DropsAnnouncementsWhoseListDoesNotEnd) {
  for (const Bytes& end : {Bytes{}, Bytes{1, 0}, Bytes{0x0a, 0x80, 40, 0}}) {
    Bytes list{0, 3, 0, 0, 0x72, 0, 4, 0, 1, 2, 3, 4};
    list.insert(list.end(), end.begin(), end.end());
    Bytes message = data_message(kPublications, 5, 16, list);
    EXPECT_EQ(filter_message(message), 0u) << end.size();
  }
}

TEST(MessageFilterInput, BlanksTypesBehindInlineQos) {
  const Bytes list{0x70, 0, 4,    0, 9, 9, 9, 9, 1, 0, 0, 0, 0, 3,
                   0,    0, 0x72, 0, 4, 0, 1, 2, 3, 4, 1, 0, 0, 0};
  Bytes blanked = list;
  blanked[16] = 0xff, blanked[17] = 0xbf;
  Bytes message = data_message(kPublications, 7, 16, list);
  EXPECT_EQ(filter_message(message), message.size());
  EXPECT_EQ(message, data_message(kPublications, 7, 16, blanked));
}

TEST(MessageFilterInput, LeavesAWithdrawalWithoutAListAlone) {
  const Bytes inline_qos{0x71, 0, 4, 0, 0, 0,
                         0,    3, 1, 0, 0, 0};  // status: disposed and unregistered
  const Bytes untouched = data_message(kPublications, 3, 16, inline_qos);
  Bytes message = untouched;
  EXPECT_EQ(filter_message(message), message.size());
  EXPECT_EQ(message, untouched);
}

/// A reliable reader waits for each sequence number, so a sample must not only be taken away.
TEST(MessageFilterOfSamples, ReplacesADisposedInstanceByAGapOfItsNumber) {
  for (const std::uint8_t status : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3}}) {
    Bytes inline_qos = kDisposed;
    inline_qos[7] = status;
    Bytes key = inline_qos;
    key.insert(key.end(), {0, 1, 0, 0, 2, 0, 0, 0, 'm', 0, 0, 0});
    for (auto message : {users_data(3, inline_qos), users_data(11, key)}) {
      const Bytes before = message;
      EXPECT_EQ(filter_message(message), message.size());
      EXPECT_EQ(message[kKindAt], 0x08);
      EXPECT_TRUE(std::equal(&before[kBodyAt + 4], &before[kBodyAt + 20], &message[kBodyAt]));
      const Bytes list{0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0};  // from number 2 on: no bits
      EXPECT_TRUE(std::equal(list.begin(), list.end(), &message[kBodyAt + 16]));
    }
  }
}

TEST(MessageFilterOfSamples, ReplacesASampleThatIsNotPlainCdr) {
  for (const auto& [first, second, passes] :
       {std::tuple{0, 0, true}, {0, 1, true}, {0, 3, false}, {0, 7, false}, {7, 1, false}}) {
    Bytes message = users_data(
        5, {static_cast<std::uint8_t>(first), static_cast<std::uint8_t>(second), 0, 0, 1, 2, 3, 4});
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message[kKindAt], passes ? 0x15 : 0x08) << first << " " << second;
  }
}

TEST(MessageFilterOfSamples, AGapOfALargeNumberInTheOtherByteOrderIsRight) {
  Bytes message = users_data(2, {0, 0x71, 0, 4, 0, 0, 0, 1, 0, 1, 0, 0});
  const Bytes number{0, 0, 0, 7, 0xff, 0xff, 0xff, 0xff};
  std::copy(number.begin(), number.end(), &message[kBodyAt + 12]);
  EXPECT_EQ(filter_message(message), message.size());
  const Bytes gap{0, 0, 0, 7, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_TRUE(std::equal(gap.begin(), gap.end(), &message[kBodyAt + 8]));
}

TEST(MessageFilterOfSamples, SkipsASampleWithoutContentThatIsTooShortForAGap) {
  Bytes message = users_data(1, {});
  EXPECT_EQ(filter_message(message), message.size());
  EXPECT_EQ(message[kKindAt], 0x7f);
}

TEST(MessageFilterOfSamples, PassesASampleWithContentAndBlanksItsKeyHash) {
  Bytes rest{0x70, 0, 16, 0};
  rest.resize(20, 9);
  rest.insert(rest.end(), {1, 0, 0, 0, 0, 1, 0, 0, 1, 2, 3, 4});
  const Bytes before = users_data(7, rest);
  Bytes message = before;
  EXPECT_EQ(filter_message(message), message.size());
  EXPECT_EQ(message[kBodyAt + 20], 0xff);
  EXPECT_EQ(message[kBodyAt + 21], 0xbf);
  EXPECT_TRUE(std::equal(before.begin() + kBodyAt + 22, before.end(), &message[kBodyAt + 22]));
}

TEST(MessageFilterOfSamples, SkipsFragmentsOfUsersAndOfKeysWithoutSignature) {
  for (Bytes message : {users_data(1, {1, 0, 0, 0, 1, 0, 64, 0, 128, 0, 0, 0, 7, 7, 7, 7}, 0x16),
                        fragment_message(kKeys, 1, 1, 128, Bytes(64, 7))}) {
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message[kKindAt], 0x7f);
  }
}

/// Fast DDS marks each number of it, and would neither end nor keep its memory.
TEST(MessageFilterOfSamples, SkipsAGapThatIsLongerThanAnyHistory) {
  for (const auto& [start, base, passes] : {std::tuple{5u, 6u, true},
                                            {5u, 5u + 1024u, true},
                                            {5u, 5u + 1025u, false},
                                            {1u, 0xffff'fff0u, false},
                                            {6u, 6u, false},
                                            {7u, 6u, false}}) {
    Bytes message = gap_message(start, base);
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message[kKindAt], passes ? 0x08 : 0x7f) << start << " to " << base;
  }
}

/// What a participant sends to the writer of gap_message(): "I wait for number `next`".
Bytes acknack(std::uint64_t next) {
  Bytes message{'R', 'T', 'P', 'S', 2, 3, 1, 15};
  message.resize(20);
  message.insert(message.end(), {0x0e, 1, 12, 0});
  message.resize(message.size() + 12);
  message.insert(message.end(), {0x06, 1, 24, 0, 0, 0, 1, 7, 0, 0, 1, 2});
  for (const auto number : {next >> 32, next & 0xffff'ffff, std::uint64_t{0}, std::uint64_t{1}})
    for (int i = 0; i < 4; ++i) message.push_back(static_cast<std::uint8_t>(number >> (8 * i)));
  return message;
}

std::uint64_t first_of(const Bytes& heartbeat) {
  std::uint64_t first = 0;
  for (const std::size_t at : {3, 2, 1, 0, 7, 6, 5, 4})
    first = first << 8 | heartbeat[kBodyAt + 8 + at];
  return first;
}
Bytes heartbeat_message(std::uint32_t first) {
  Bytes message = gap_message(first, first + 5);
  message[kKindAt] = 0x07;
  return message;
}

/// Fast DDS keeps each number of a gap, and each sample number, until the ones before have come.
TEST(MessageFilterOfNumbers, SkipsAGapAheadOfWhatTheReaderWaitsFor) {
  SequenceWindow window;
  const auto passes = [&window](std::uint32_t start) {
    Bytes message = gap_message(start, start + 1);
    EXPECT_EQ(filter_message(message, Protection::None, &window), message.size());
    return message[kKindAt] == 0x08;
  };
  EXPECT_TRUE(passes(1024));
  EXPECT_FALSE(passes(1025)) << "it has not asked yet: it waits for number 1";
  window.sent(acknack(1'000'000));
  EXPECT_TRUE(passes(1'001'023));
  EXPECT_FALSE(passes(1'001'024));
}

TEST(MessageFilterOfNumbers, SkipsASampleAheadOfWhatAReliableReaderWaitsFor) {
  SequenceWindow window;
  Bytes sample = users_data(5, {0, 1, 0, 0, 1, 2, 3, 4});
  sample[kBodyAt + 18] = 1;  // number 65537
  const auto kind = [&] {
    Bytes message = sample;
    EXPECT_EQ(filter_message(message, Protection::None, &window), message.size());
    return message[kKindAt];
  };
  EXPECT_EQ(kind(), 0x15) << "never asked: of a best-effort writer";
  window.sent(acknack(7));
  EXPECT_EQ(kind(), 0x7f);
  window.sent(acknack(65000));
  EXPECT_EQ(kind(), 0x15);
}

/// Fast DDS counts to the first number one by one: a far one would stop it for hours.
TEST(MessageFilterOfNumbers, AHeartbeatSkipsNoMoreThanAFewMillionNumbers) {
  SequenceWindow window;
  window.sent(acknack(100));
  for (const auto& [first, expected] :
       {std::pair{200u, 200u}, {4'000'000'000u, 100u + (1u << 22)}}) {
    Bytes message = heartbeat_message(first);
    EXPECT_EQ(filter_message(message, Protection::None, &window), message.size());
    EXPECT_EQ(first_of(message), expected);
  }
  const SequenceWindow other;
  Bytes next = heartbeat_message(1'000'000);
  EXPECT_EQ(filter_message(next, Protection::None, &other), next.size());
  EXPECT_EQ(first_of(next), 1'000'000);
}

TEST(MessageFilterOfNumbers, TheHeartbeatsOfManyWritersShareWhatTheyMaySkip) {
  const SequenceWindow window;
  std::uint64_t skipped = 0;
  for (int i = 0; i < 1000; ++i) skipped += window.take_skip(1'000'000'000);
  // Should the test take longer than a second, some seconds' worth.
  EXPECT_LE(skipped, 100 * SequenceWindow::kLongestSkip);
  EXPECT_GE(skipped, SequenceWindow::kLongestSkip);
  EXPECT_EQ(window.take_skip(1024), 1024) << "lost samples are always skipped";
}

TEST(MessageFilterOfNumbers, SkipsAnAnnouncementFarAhead) {
  SequenceWindow window;
  for (const std::uint8_t number : {std::uint8_t{32}, std::uint8_t{33}}) {
    Bytes message = announcement(kPublications, {kDurability});
    message[kBodyAt + 16] = number;
    EXPECT_EQ(filter_message(message, Protection::None, &window), message.size());
    EXPECT_EQ(message[kKindAt], number == 32 ? 0x15 : 0x7f);
  }
}

TEST(MessageFilterOfNumbers, AWriterBehindAnotherSourceIsAnother) {
  SequenceWindow window;
  window.sent(acknack(1'000'000));
  Bytes message = gap_message(1'000'000, 1'000'001);
  Bytes source{0x0c, 1, 20, 0, 0, 0, 0, 0, 2, 3, 1, 15};
  source.resize(24, 9);
  message.insert(message.begin() + kKindAt, source.begin(), source.end());
  EXPECT_EQ(filter_message(message, Protection::None, &window), message.size());
  EXPECT_EQ(message[kKindAt + source.size()], 0x7f);
}

TEST(SequenceWindow, ForgetsTheWriterThatWasAskedFirst) {
  SequenceWindow window;
  const auto writer = [](std::size_t i) {
    SequenceWindow::WriterGuid guid{};
    guid[0] = static_cast<std::uint8_t>(i >> 8), guid[1] = static_cast<std::uint8_t>(i);
    guid[14] = 1, guid[15] = 2;
    return guid;
  };
  for (std::size_t i = 0; i <= SequenceWindow::kMostWriters; ++i) {
    Bytes message = acknack(i + 1);
    std::copy_n(writer(i).begin(), 12, message.begin() + 24);
    window.sent(message);
  }
  EXPECT_FALSE(window.next_of(writer(0)));
  EXPECT_EQ(window.next_of(writer(1)), 2);
  Bytes cut = acknack(1);
  for (; !cut.empty(); cut.pop_back()) window.sent(cut);
}

/// A participant that announces an endless lease and leaves would stay in memory.
TEST(MessageFilterInput, ShortensTheLeaseOfAParticipant) {
  for (const auto& [seconds, expected] : {std::pair{40u, 40u},
                                          {100u, 100u},
                                          {101u, 100u},
                                          {0x7fffffffu, 100u},
                                          {0xffffffffu, 100u}}) {
    Bytes list{0, 3, 0, 0, 2, 0, 8, 0};
    for (int i = 0; i < 4; ++i) list.push_back(static_cast<std::uint8_t>(seconds >> (8 * i)));
    list.insert(list.end(), {9, 9, 9, 9, 1, 0, 0, 0});
    Bytes message = data_message(0x01, 5, 16, list);
    message[33] = 1, message[34] = 0;  // entity 000100c2
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message[kBodyAt + 28], expected) << seconds;
    EXPECT_EQ(message[kBodyAt + 31], 0) << seconds;
  }
}

TEST(MessageFilterInput, ReplacesALongAnnouncementByAGap) {
  Bytes list{0, 3, 0, 0, 0x2c, 0, 0x20, 0x40};
  list.resize(list.size() + 0x4020);
  list.insert(list.end(), {1, 0, 0, 0});
  Bytes message = data_message(kPublications, 5, 16, list);
  EXPECT_EQ(filter_message(message), message.size());
  EXPECT_EQ(message[20], 0x08) << "the reader goes on to later announcements";
}

/// Fast DDS asserts that it can add to a sequence number.
TEST(MessageFilterOfSamples, SkipsSequenceNumbersNearTheLargest) {
  Bytes data = users_data(5, {0, 1, 0, 0, 1, 2, 3, 4});
  const Bytes largest{0xff, 0xff, 0xff, 0x7f, 0, 0, 0, 0};
  std::copy(largest.begin(), largest.end(), &data[kBodyAt + 12]);
  EXPECT_EQ(filter_message(data), 0u);

  for (const std::uint8_t kind : {std::uint8_t{0x06}, std::uint8_t{0x07}, std::uint8_t{0x08}}) {
    Bytes message = gap_message(5, 6);
    message[kKindAt] = kind;
    const Bytes before = message;
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message, before);
    const std::size_t at = kind == 0x06 ? 8 : 16;
    std::copy(largest.begin(), largest.end(), &message[kBodyAt + at]);
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message[kKindAt], 0x7f) << int{kind};
  }
}

/// A sample dated in the future would keep the later ones of all publishers out of the history.
TEST(MessageFilterOfSamples, TakesTimeStampsAway) {
  Bytes message{'R', 'T', 'P', 'S', 2,    3, 1, 15, 0,    0,    0,    0,    0, 0, 0, 0,
                0,   0,   0,   0,   0x09, 1, 8, 0,  0xff, 0xff, 0xff, 0x7f, 0, 0, 0, 0};
  EXPECT_EQ(filter_message(message), message.size());
  EXPECT_EQ(message[kKindAt + 1], 3);
}

/// Fast DDS delivers to the reader that is stated, also from an unknown writer.
TEST(MessageFilterOfSamples, SkipsDataOfAnotherWriterThanThatOfTheReader) {
  const Bytes sample{0, 1, 0, 0, 1, 2, 3, 4};
  const auto data = [&](const Bytes& reader, const Bytes& writer) {
    Bytes message = users_data(5, sample);
    std::copy(reader.begin(), reader.end(), &message[kBodyAt + 4]);
    std::copy(writer.begin(), writer.end(), &message[kBodyAt + 8]);
    static_cast<void>(filter_message(message));
    return message[kKindAt];
  };
  const Bytes of_authentication{0, 2, 1, 0xc4}, users{0, 0, 1, 7};
  EXPECT_EQ(data(of_authentication, {0, 0, 0, 0}), 0x7f);
  EXPECT_EQ(data(of_authentication, {0, 0, 1, 2}), 0x7f);
  EXPECT_EQ(data({0, 0, 3, 0xc7}, {0, 2, 0, 0xc2}), 0x7f);
  EXPECT_EQ(data(users, {0, 0, 1, 2}), 0x15);
  EXPECT_EQ(data({0, 0, 0, 0}, {0, 0, 1, 2}), 0x15);
}

TEST(MessageFilterOfSamples, SkipsAShortLivelinessMessage) {
  for (const std::size_t bytes : {16u, 20u}) {
    Bytes message = data_message(0, 5, 16, Bytes(bytes));
    const Bytes writer{0, 2, 0, 0xc2};
    std::copy(writer.begin(), writer.end(), &message[kBodyAt + 8]);
    EXPECT_EQ(filter_message(message), message.size());
    EXPECT_EQ(message[kKindAt], bytes < 20 ? 0x7f : 0x15);
  }
}

/// With AddressSanitizer: every truncation, and every wrong length.
TEST(MessageFilterInput, NeverReadsBeyondTheMessage) {
  const Bytes list = announcement(kPublications, {kDurability, kTypeObject, kTypeInformation});
  for (const Bytes& whole :
       {list, users_data(3, kDisposed), users_data(1, Bytes(16), 0x16), gap_message(5, 6)})
    for (std::size_t cut = 0; cut <= whole.size(); ++cut) {
      Bytes message(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut));
      static_cast<void>(filter_message(message));
      for (std::size_t at = 20; at < cut; ++at) {
        Bytes lying = Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(cut));
        lying[at] = 0xff;
        static_cast<void>(filter_message(lying));
      }
    }
}

}  // namespace
}  // namespace abbe::dds
