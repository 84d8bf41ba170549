#include "abbe/protocol/time.hpp"

#include <gtest/gtest.h>

#include <type_traits>

namespace abbe::protocol {
namespace {

template <class A, class B>
concept Subtractable = requires(A a, B b) {
  a - b;
};

TEST(Time, InstantsOfTwoClocksCannotBeSubtracted) {
  static_assert(Subtractable<HostTime, HostTime>);
  static_assert(!Subtractable<HostTime, DeviceTime>);
  static_assert(!Subtractable<HostTime, UtcTime>);
  SUCCEED();
}

TEST(Time, UtcOffsetConvertsThereAndBack) {
  const UtcOffset offset{std::chrono::seconds{1'700'000'000}};
  const HostTime t{std::chrono::milliseconds{1234}};
  EXPECT_EQ(offset.to_utc(t).time_since_epoch(), std::chrono::milliseconds{1'700'000'001'234});
  EXPECT_EQ(offset.to_host(offset.to_utc(t)), t);
}

}  // namespace
}  // namespace abbe::protocol
