#pragma once
/// A tracker whose points come as lines of text, as running device and as decoder of its recording.

#include <cstddef>
#include <memory>
#include <string>

#include "abbe/devices/device_kind.hpp"
#include "abbe/drivers/lines/device.hpp"

namespace abbe::daemon {

/// `place`: index in DeviceNames::all.
[[nodiscard]] Result<std::unique_ptr<RunningDevices>> start_line_tracker(
    const DeviceStart& start, const drivers::LineTrackerOptions& options, std::size_t place);
[[nodiscard]] std::unique_ptr<RawDecoders> line_decoder(const drivers::LineTrackerOptions& options);

}  // namespace abbe::daemon
