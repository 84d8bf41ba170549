#include "abbe/notify/delivery_queue.hpp"

#include <gmock/gmock.h>

namespace abbe::notify {
namespace {

using namespace std::chrono_literals;

constexpr DeliveryQueue::Time kQueueStart{std::chrono::hours{1}};

Notification queued(int number) {
  return {.id = std::to_string(number)};
}

DeliveryQueue queue_of(int count, std::size_t most = DeliveryQueue::kMostWaiting) {
  DeliveryQueue queue({.first = 5s, .longest = 12s}, most);
  for (int i = 1; i <= count; ++i) queue.push(queued(i));
  return queue;
}

TEST(DeliveryQueue, KeepsTheOrder) {
  auto queue = queue_of(2);
  EXPECT_EQ(queue.take(kQueueStart)->notification.id, "1");
  queue.accepted();
  EXPECT_EQ(queue.take(kQueueStart)->notification.id, "2");
  queue.accepted();
  EXPECT_FALSE(queue.take(kQueueStart));
  EXPECT_FALSE(queue.next());
}

TEST(DeliveryQueue, RepeatsWithGrowingPauses) {
  auto queue = queue_of(1);
  auto now = kQueueStart;
  for (const auto pause : {5s, 10s, 12s, 12s}) {
    EXPECT_EQ(queue.take(now)->notification.id, "1");
    EXPECT_EQ(queue.failed(now), pause);
    EXPECT_FALSE(queue.take(now + pause - 1ms));
    EXPECT_EQ(queue.next(), now + pause);
    now += pause;
  }
  EXPECT_TRUE(queue.take(now));
  queue.accepted();
  queue.push(queued(2));
  EXPECT_TRUE(queue.take(now));
  EXPECT_EQ(queue.failed(now), 5s) << "the first pause again";
}

TEST(DeliveryQueue, DropsTheOldestAndCountsIt) {
  auto queue = queue_of(14, 2);
  EXPECT_EQ(queue.not_delivered(), 12u);
  const auto attempt = queue.take(kQueueStart);
  EXPECT_EQ(attempt->notification.id, "13");
  EXPECT_EQ(attempt->not_delivered, 12u);
  queue.accepted();
  EXPECT_EQ(queue.take(kQueueStart)->not_delivered, 0u) << "reported once";
}

TEST(DeliveryQueue, DropsWhatFailedIfTheQueueFilledMeanwhile) {
  auto queue = queue_of(1, 2);
  EXPECT_TRUE(queue.take(kQueueStart));
  queue.push(queued(2));
  queue.push(queued(3));
  (void)queue.failed(kQueueStart);
  const auto attempt = queue.take(kQueueStart + 5s);
  EXPECT_EQ(attempt->notification.id, "2");
  EXPECT_EQ(attempt->not_delivered, 1u);
}

TEST(DeliveryQueue, StillReportsWhatWasLostDuringTheReport) {
  auto queue = queue_of(3, 2);
  EXPECT_EQ(queue.take(kQueueStart)->not_delivered, 1u);
  for (int i = 4; i <= 6; ++i) queue.push(queued(i));
  queue.accepted();
  EXPECT_EQ(queue.take(kQueueStart)->not_delivered, 2u);
}

TEST(DeliveryQueue, CountsWhatTheReceiverRefuses) {
  auto queue = queue_of(2);
  EXPECT_TRUE(queue.take(kQueueStart));
  queue.refused();
  const auto attempt = queue.take(kQueueStart);
  EXPECT_EQ(attempt->notification.id, "2");
  EXPECT_EQ(attempt->not_delivered, 1u);
}

}  // namespace
}  // namespace abbe::notify
