#include "abbe/dds/readers.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/writers.hpp"
#include "domain_claim.hpp"
#include "sample_messages.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using daemon::Topic;

class DdsReaders : public testing::Test {
 protected:
  void write_state(std::uint64_t number) {
    std::vector<std::byte> payload;
    ASSERT_TRUE(daemon::encode(active_state(number), payload));
    ASSERT_TRUE(writers_.write(Topic::ModelState, payload));
  }
  /// Until `done`, or for so long that no lease lasts.
  template <class Done>
  bool comes(Done done) {
    for (const auto end = Clock::now() + 20s; Clock::now() < end; readers_.wait(20ms))
      if (done()) return true;
    return false;
  }
  int take() {
    int taken = 0;
    readers_.take([&](const dds::Arrival& arrival) {
      writer_ = arrival.writer;
      ++taken;
    });
    return taken;
  }

  DomainClaim domain_;
  dds::ParticipantOptions options_{.domain = static_cast<std::uint32_t>(std::stoul(domain_.text())),
                                   .profiles = ABBE_LOOPBACK_PROFILE};
  dds::Participant publisher_ = dds::Participant::create(options_).value();
  dds::Writers writers_ = dds::Writers::create(publisher_).value();
  dds::Participant subscriber_ = dds::Participant::create(options_).value();
  dds::Readers readers_ = dds::Readers::create(subscriber_, std::array{Topic::ModelState}).value();
  dds::WriterId writer_{};
};

/// As where the program that reads was held up by its terminal.
TEST_F(DdsReaders, ASampleTakenAfterItsWriterWasLostDoesNotAssertLiveliness) {
  write_state(1);
  ASSERT_TRUE(comes([this] { return take() > 0; }));
  EXPECT_TRUE(readers_.is_alive(writer_));
  write_state(2);  // arrives, and is not taken
  ASSERT_TRUE(comes([this] { return !readers_.is_alive(writer_); }));
  EXPECT_EQ(take(), 1);
  EXPECT_FALSE(readers_.is_alive(writer_));

  write_state(3);
  ASSERT_TRUE(comes([this] { return take() > 0; }));
  EXPECT_TRUE(readers_.is_alive(writer_));
}

}  // namespace
}  // namespace abbe::test
