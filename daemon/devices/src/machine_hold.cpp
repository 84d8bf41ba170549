#include "machine_hold.hpp"

#include <fmt/format.h>

#include <memory>
#include <string>
#include <string_view>
#include <system_error>

#include "abbe/base/text_file.hpp"
#include "machine_hold_writer.hpp"

namespace abbe::daemon {
namespace {

/// First line of the file while a motion is under way.
constexpr std::string_view kMoving = "a motion is under way\n";
constexpr std::string_view kSince = "since before the restart: ";

drivers::IppMachine unreadable(const std::filesystem::path& file, const std::string& why) {
  return {fmt::format("{}unknown reason, {} cannot be read: {}", kSince, file.string(), why), true};
}

/// State of the machine from the file. A missing file means that the machine awaits no release. If
/// the file cannot be read, it is assumed that the machine awaits a release.
drivers::IppMachine read_hold(const std::filesystem::path& file) {
  std::error_code failed;
  const auto status = std::filesystem::status(file, failed);
  if (status.type() == std::filesystem::file_type::not_found) return {};
  if (failed) return unreadable(file, failed.message());

  auto content = read_regular_file(file);
  if (!content) return unreadable(file, content.error().text);
  constexpr std::size_t kMost = 4096;
  std::string text = content->substr(0, kMost);
  const bool moving = text.starts_with(kMoving);
  if (moving) text.erase(0, kMoving.size());
  if (text.empty()) text = moving ? "abbed ended while the machine was moving" : "unknown reason";
  if (!text.starts_with(kSince)) text.insert(0, kSince);

  return {text, moving};
}

}  // namespace

std::string hold_text(const drivers::IppMachine& machine) {
  return fmt::format("{}{}", machine.moving ? kMoving : "", machine.held);
}

void keep_hold(const std::filesystem::path& data_dir, drivers::IppDeviceOptions& options) {
  const auto file = data_dir / "machine-hold";
  const drivers::IppMachine machine = read_hold(file);
  options.session.held = machine.held;
  options.session.moving = machine.moving;
  // The writer is shared by the two functions and is destroyed with the device.
  const auto writer = std::make_shared<MachineHoldWriter>(file, machine);
  options.machine_changed = [writer](const drivers::IppMachine& m) { writer->keep(m); };
  options.machine_stored = [writer] { return writer->stored(); };
}

}  // namespace abbe::daemon
