// Instantiates the ring's real-time functions for every sample type, so that the symbol check of
// this folder's object files covers them. Single members only: the constructor allocates.

#include "abbe/drivers/sample_ring.hpp"

namespace abbe::drivers {

template bool SampleRing<protocol::TrackerPoint>::try_push(const protocol::TrackerPoint&) ABBE_RT;
template std::size_t SampleRing<protocol::TrackerPoint>::push(
    std::span<const protocol::TrackerPoint>) ABBE_RT;
template std::size_t SampleRing<protocol::TrackerPoint>::pop(
    std::span<protocol::TrackerPoint>) ABBE_RT;
template bool SampleRing<protocol::AxisSample>::try_push(const protocol::AxisSample&) ABBE_RT;
template std::size_t SampleRing<protocol::AxisSample>::push(
    std::span<const protocol::AxisSample>) ABBE_RT;
template std::size_t SampleRing<protocol::AxisSample>::pop(std::span<protocol::AxisSample>) ABBE_RT;
template bool SampleRing<protocol::ProbeTrigger>::try_push(const protocol::ProbeTrigger&) ABBE_RT;
template std::size_t SampleRing<protocol::ProbeTrigger>::push(
    std::span<const protocol::ProbeTrigger>) ABBE_RT;
template std::size_t SampleRing<protocol::ProbeTrigger>::pop(
    std::span<protocol::ProbeTrigger>) ABBE_RT;
template bool SampleRing<protocol::EnvironmentSample>::try_push(
    const protocol::EnvironmentSample&) ABBE_RT;
template std::size_t SampleRing<protocol::EnvironmentSample>::push(
    std::span<const protocol::EnvironmentSample>) ABBE_RT;
template std::size_t SampleRing<protocol::EnvironmentSample>::pop(
    std::span<protocol::EnvironmentSample>) ABBE_RT;
template bool SampleRing<protocol::TouchScan>::try_push(const protocol::TouchScan&) ABBE_RT;
template std::size_t SampleRing<protocol::TouchScan>::push(
    std::span<const protocol::TouchScan>) ABBE_RT;
template std::size_t SampleRing<protocol::TouchScan>::pop(std::span<protocol::TouchScan>) ABBE_RT;

}  // namespace abbe::drivers
