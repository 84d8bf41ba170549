// The whole daemon with all devices at once for as long as wanted, on this computer and in its own
// time: needs root, no guest. scripts/soak runs it; a computer that is busy with other things may
// fail it.
//
// ABBE_HIL_SECONDS: default 20.

#include "counter_card_daemon.hpp"

namespace abbe::tests {
namespace {

TEST_F(CounterCardDaemon, AcquiresFromAllDevicesWithoutLossOnThisComputer) {
  ASSERT_NO_FATAL_FAILURE(expect_nothing_lost_from_all());
}

}  // namespace
}  // namespace abbe::tests
