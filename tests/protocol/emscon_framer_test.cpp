#include "abbe/protocol/emscon/framer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "emscon_samples.hpp"

namespace abbe::protocol::emscon {
namespace {

using samples::Bytes;
using samples::from_hex;

Bytes joined(const std::vector<Bytes>& packets) {
  Bytes stream;
  for (const Bytes& p : packets) stream.insert(stream.end(), p.begin(), p.end());
  return stream;
}

class EmsconFramer : public testing::Test {
 protected:
  std::vector<Bytes> drain() {
    std::vector<Bytes> packets;
    while (const auto packet = framer_->next())
      packets.emplace_back(packet->begin(), packet->end());
    return packets;
  }
  std::vector<Bytes> feed(std::span<const std::byte> bytes) {
    EXPECT_EQ(framer_->push(bytes), bytes.size());
    return drain();
  }

  std::unique_ptr<PacketFramer> framer_ = std::make_unique<PacketFramer>();
};

TEST_F(EmsconFramer, GivesThePacketsOfOneRead) {
  const auto packets = samples::controller_packets();
  EXPECT_EQ(feed(joined(packets)), packets);
}

TEST_F(EmsconFramer, GivesTheSamePacketsAcrossAnySplit) {
  const std::vector<Bytes> packets{
      from_hex("0c000000 00000000 01000000"),
      samples::encoded(samples::head(), std::span<const MultiPoint>{samples::points()}),
      from_hex("0c000000 08000000 1b000000")};
  const Bytes stream = joined(packets);
  for (std::size_t cut = 0; cut <= stream.size(); ++cut) {
    framer_->reset();
    auto got = feed(std::span{stream}.first(cut));
    const auto rest = feed(std::span{stream}.subspan(cut));
    got.insert(got.end(), rest.begin(), rest.end());
    ASSERT_EQ(got, packets) << "cut at " << cut;
  }
}

TEST_F(EmsconFramer, GivesTheSamePacketsByteByByte) {
  const auto packets = samples::controller_packets();
  std::vector<Bytes> got;
  for (const std::byte b : joined(packets)) {
    for (auto& packet : feed(std::span{&b, 1})) got.push_back(std::move(packet));
  }
  EXPECT_EQ(got, packets);
}

TEST_F(EmsconFramer, TakesTheLargestPacketsOneAfterAnother) {
  Bytes largest(kMaxPacketSize);
  largest[2] = std::byte{1};  // 65536
  std::mt19937 random{1};
  std::size_t whole = 0;
  Bytes stream = joined({largest, largest, largest, largest});

  for (std::span<const std::byte> rest{stream}; !rest.empty();) {
    const auto piece =
        rest.first(std::min<std::size_t>(rest.size(), 1 + random() % kMaxPacketSize));
    for (const Bytes& packet : feed(piece)) {
      EXPECT_EQ(packet.size(), kMaxPacketSize);
      ++whole;
    }
    rest = rest.subspan(piece.size());
  }

  EXPECT_EQ(whole, 4u);
}

TEST_F(EmsconFramer, RefusesAnImpossibleSize) {
  for (const char* head :
       {"07000000 00000000", "00000000 00000000", "01000100 00000000", "ffffffff 00000000"}) {
    framer_->reset();
    EXPECT_TRUE(feed(from_hex(head)).empty());
    EXPECT_TRUE(framer_->broken()) << head;
  }
}

TEST_F(EmsconFramer, StaysBrokenUntilReset) {
  const Bytes good = from_hex("0c000000 08000000 1b000000");
  feed(from_hex("48545450 2f312e31"));
  EXPECT_TRUE(feed(good).empty());
  EXPECT_TRUE(framer_->broken());
  framer_->reset();
  EXPECT_EQ(feed(good), std::vector<Bytes>{good});
}

TEST_F(EmsconFramer, ShowsTheBytesItRefused) {
  const Bytes nonsense = from_hex("48545450 2f312e31");
  feed(nonsense);
  EXPECT_TRUE(std::ranges::equal(framer_->refused(), nonsense));
}

TEST_F(EmsconFramer, ResyncFindsTheNextPacketAfterAHole) {
  const Bytes multi =
      samples::encoded(samples::head(), std::span<const MultiPoint>{samples::points()});
  const Bytes stream = joined({multi, multi, multi});
  framer_->resync();
  EXPECT_EQ(feed(std::span{stream}.subspan(70)), (std::vector<Bytes>{multi, multi}));
}

TEST_F(EmsconFramer, ASecondPushWithoutReadingTakesOnlyWhatFits) {
  const Bytes block(kMaxPacketSize + 1);
  EXPECT_EQ(framer_->push(block), block.size());
  EXPECT_EQ(framer_->push(block), PacketFramer::kCapacity - block.size());
}

}  // namespace
}  // namespace abbe::protocol::emscon
