#pragma once
/// Makes the options of the parts that abbed starts from its configuration. Pure functions.

#include <string>

#include "abbe/config/config.hpp"
#include "abbe/messages/dds_process.hpp"
#include "abbe/publishing/dds_supervisor.hpp"
#include "abbe/publishing/publisher.hpp"
#include "abbe/recording/recorder_thread.hpp"

namespace abbe::daemon {

/// `name`: name of the recording, without folder and extension.
[[nodiscard]] RecorderThreadOptions recorder_options(const Config&, const std::string& name);

[[nodiscard]] PublisherOptions publisher_options(const Config&);

/// Command line and priority of abbe-dds as a child. `program`: its path. `process` must outlive
/// the supervisor.
[[nodiscard]] DdsSupervisor::Options abbe_dds_options(const Config&, const std::string& program,
                                                      DdsProcess& process);

}  // namespace abbe::daemon
