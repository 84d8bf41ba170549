#pragma once
/// A small simulated machine, abbed and the tools, each a process of its own, in a folder that goes
/// with the test.

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "domain_claim.hpp"
#include "program.hpp"

namespace abbe::test {

struct Outcome {
  int code = 0;
  std::string out;
  std::string err;
};

class Spine : public testing::Test {
 protected:
  using Vertices = std::vector<std::array<double, 3>>;  ///< mm

  /// `rotary_axes`: a letter for each; they swing, and move nothing.
  explicit Spine(std::string_view rotary_axes = {});
  ~Spine() override;

  // Files of the run.
  void write(const std::string& name, const std::string& text) const;
  void write_path(const std::string& name, const Vertices& vertices_mm) const;
  /// Edges and diagonals between the corners, edge and face centres of the volume: all its errors
  /// show.
  static Vertices path();
  /// abbed.toml for the simulator's ports. `dds`: [dds] supervise.
  void write_configuration(const std::string& dds = "off") const;
  /// The same with other devices.
  void write_configuration_of(const std::string& devices, const std::string& dds = "off") const;
  [[nodiscard]] std::string tracker_table() const;
  /// [daemon], [recording] and [dds].
  [[nodiscard]] std::string daemon_tables(const std::string& dds) const;
  [[nodiscard]] std::string file(const std::string& name) const {
    return (directory_ / name).string();
  }

  // Programs.
  void
  start_simulator();  ///< drives path.csv once the tracker streams; its ports are known afterwards
  void start_simulator_as(
      std::vector<std::string> command);  ///< that writes the file "ports" when it is up
  /// The simulator's port of that name; 0: it has none.
  [[nodiscard]] std::uint16_t port(const std::string& name) const;
  void start_abbed();  ///< returns when it answers
  /// Before start_abbed(), when it is to calibrate: at many times real time the standstill at the
  /// first vertex would be over before a client could request a calibration.
  void hold_simulator() const;
  /// `abbe calibrate otf` to its end; lets the simulator go on once the session waits for the
  /// machine.
  [[nodiscard]] Outcome calibrate(const std::string& path) const;
  Outcome run(std::vector<std::string> command) const;
  [[nodiscard]] std::unique_ptr<Program> start(std::vector<std::string> command,
                                               const std::string& log) const;

  // What abbed reports.
  [[nodiscard]] nlohmann::json status() const;  ///< null while it does not answer
  [[nodiscard]] nlohmann::json stream(const std::string& name) const;  ///< of the status
  [[nodiscard]] std::uint64_t samples(const std::string& name) const;
  /// True when the stream brings more samples from now on.
  [[nodiscard]] bool goes_on(const std::string& name) const;
  [[nodiscard]] std::vector<std::filesystem::path> recordings() const;  ///< finished or not, sorted

  std::string_view rotary_axes_;
  std::filesystem::path directory_;
  DomainClaim domain_;
  std::uint16_t tracker_port_ = 0;
  std::uint16_t can_port_ = 0;
  std::unique_ptr<Program> simulator_;
  std::unique_ptr<Program> abbed_;
};

}  // namespace abbe::test
