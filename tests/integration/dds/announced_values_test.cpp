// Values of announcements, and messages of authentication, that state more than they have.
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "abbe/subscriber/message_filter.hpp"
#include "rtps_message.hpp"

namespace abbe::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kKindAt = 20;
constexpr std::uint8_t kSkipped = 0x7f, kGap = 0x08, kData = 0x15;
constexpr std::uint32_t kAuthenticationWriter = 0x000201c3;

/// A value in CDR, and where it states a length or a number of elements.
struct Value {
  Bytes bytes;
  std::vector<std::size_t> counts;

  Value& count(std::uint32_t n) {
    counts.push_back(bytes.size());
    for (unsigned i = 0; i < 4; ++i) bytes.push_back(static_cast<std::uint8_t>(n >> (8 * i)));
    return *this;
  }
  Value& octets(const Bytes& content) {
    count(static_cast<std::uint32_t>(content.size()));
    bytes.insert(bytes.end(), content.begin(), content.end());
    bytes.resize((bytes.size() + 3) / 4 * 4);
    return *this;
  }
  Value& text(const std::string& content) {
    const char* const c = content.c_str();
    return octets({c, c + content.size() + 1});
  }
  Value& token() {
    text("class").count(1).text("name").text("value");
    return count(2).text("a").octets({1, 2, 3}).text("bc").octets({});
  }
};

struct Parameter {
  std::uint16_t id;
  Value value;
};

std::vector<Parameter> parameters() {
  return {{0x0005, Value{}.text("abbe/v1/ModelState")},
          {0x0007, Value{}.text("")},
          {0x0062, Value{}.text("entity")},
          {0x002c, Value{}.octets({1, 2, 3, 4, 5})},
          {0x002d, Value{}.octets({})},
          {0x002e, Value{}.octets({1})},
          {0x0029, Value{}.count(3).text("a").text("").text("partition")},
          {0x0059, Value{}.count(2).text("a").text("b").text("name").text("")},
          {0x0073, Value{.bytes = {2, 0, 0, 0, 0, 0, 2, 0}, .counts = {0}}},
          {0x1001, Value{}.token()},
          {0x1002, Value{}.token()}};
}

Bytes announcement(std::uint32_t writer, std::uint16_t id, const Bytes& value) {
  RtpsMessage m({1, 2, 3});
  m.data(writer, 1).append({0, 3, 0, 0}).parameter(id, value).end_of_parameters().end();
  return m.bytes();
}

Bytes authentication(const Bytes& content) {
  RtpsMessage m({1, 2, 3});
  m.data(kAuthenticationWriter, 1).append({0, 1, 0, 0}).append(Bytes(96, 7)).append(content).end();
  return m.bytes();
}

/// The kind of the submessage behind the filter.
std::uint8_t kind_after(Bytes message) {
  EXPECT_EQ(dds::filter_message(message, dds::Protection::Profile), message.size());
  return message[kKindAt];
}

/// The value with each of its counts, one after the other, too large: by little up to 2^32 - 1.
std::vector<Bytes> with_wrong_counts(const Value& value) {
  std::vector<Bytes> wrong;
  for (const std::size_t at : value.counts)
    for (const std::uint32_t stated :
         {static_cast<std::uint32_t>(value.bytes.size() + 1), std::uint32_t{1} << 26,
          std::uint32_t{0xffff'fff0}, std::numeric_limits<std::uint32_t>::max()}) {
      Bytes bytes = value.bytes;
      for (unsigned i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(stated >> (8 * i));
      wrong.push_back(bytes);
    }
  return wrong;
}

TEST(AnnouncedValues, ThatStateTheirLengthsPassUnchanged) {
  for (const auto writer : {kParticipantWriter, kPublicationsWriter, kSubscriptionsWriter})
    for (const auto& [id, value] : parameters()) {
      Bytes message = announcement(writer, id, value.bytes);
      const Bytes before = message;
      EXPECT_EQ(dds::filter_message(message), message.size()) << id;
      EXPECT_EQ(message, before) << id;
    }
}

TEST(AnnouncedValues, ThatStateMoreThanTheyHaveAreLeftOut) {
  for (const auto& [id, value] : parameters())
    for (const Bytes& wrong : with_wrong_counts(value)) {
      EXPECT_EQ(kind_after(announcement(kParticipantWriter, id, wrong)), kSkipped) << id;
      for (const auto writer : {kPublicationsWriter, kSubscriptionsWriter})
        EXPECT_EQ(kind_after(announcement(writer, id, wrong)), kGap)
            << id << ": the reader must go on to later announcements";
    }
}

/// Fast DDS reads text up to an octet 0, wherever it comes.
TEST(AnnouncedValues, OfTextWithoutAnEndAreLeftOut) {
  for (const std::uint16_t id : {std::uint16_t{0x0005}, std::uint16_t{0x0007}}) {
    EXPECT_EQ(kind_after(announcement(kPublicationsWriter, id, {4, 0, 0, 0, 'a', 'b', 'c', 'd'})),
              kGap);
    EXPECT_EQ(kind_after(announcement(kPublicationsWriter, id, {0, 0, 0, 0})), kGap);
    EXPECT_EQ(kind_after(announcement(kPublicationsWriter, id, {})), kGap);
  }
  const Bytes partition{1, 0, 0, 0, 4, 0, 0, 0, 'a', 'b', 'c', 'd'};
  EXPECT_EQ(kind_after(announcement(kSubscriptionsWriter, 0x0029, partition)), kGap);
}

/// Announcements that Fast DDS refuses stay in its memory.
TEST(AnnouncedValues, OfAnotherLengthThanThatOfTheirTypeAreLeftOut) {
  for (const auto& [id, right] : {std::pair<std::uint16_t, std::size_t>{0x001d, 4},
                                  {0x001a, 12},
                                  {0x001b, 12},
                                  {0x0032, 24},
                                  {0x0070, 16},
                                  {0x0023, 8}})
    for (const std::size_t length : {std::size_t{0}, right - 4, right, right + 4})
      EXPECT_EQ(kind_after(announcement(kPublicationsWriter, id, Bytes(length))),
                length == right ? kData : kGap)
          << id << ", " << length;
  const Bytes long_name = Value{}.text(std::string(260, 'a')).bytes;
  EXPECT_EQ(kind_after(announcement(kPublicationsWriter, 0x0005, long_name)), kGap);
}

TEST(AnnouncedValues, OfAnEndpointOfAnotherParticipantAreLeftOut) {
  Bytes guid{1, 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2};
  EXPECT_EQ(kind_after(announcement(kPublicationsWriter, 0x005a, guid)), kData);
  guid[0] = 2;
  EXPECT_EQ(kind_after(announcement(kPublicationsWriter, 0x005a, guid)), kGap);
}

TEST(AnnouncedValues, OfContentFiltersAndDataSharingAreBlanked) {
  for (const std::uint16_t id : {std::uint16_t{0x0035}, std::uint16_t{0x8006}}) {
    Bytes message = announcement(kSubscriptionsWriter, id, Bytes(8, 0xff));
    EXPECT_EQ(dds::filter_message(message), message.size());
    EXPECT_EQ(message, announcement(kSubscriptionsWriter, 0xbfff, Bytes(8, 0xff)));
  }
}

TEST(AnnouncedValues, OfAuthenticationMustStateTheirLengths) {
  const Value right = Value{}.text("dds.sec.auth").count(1).token();
  EXPECT_EQ(kind_after(authentication(right.bytes)), kData);
  EXPECT_EQ(kind_after(authentication({})), kSkipped);
  for (const Bytes& wrong : with_wrong_counts(right))
    EXPECT_EQ(kind_after(authentication(wrong)), kSkipped);
}

}  // namespace
}  // namespace abbe::test
