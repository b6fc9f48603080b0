#pragma once
#include <algorithm>
#include <array>
#include <gsp/sensor/sensor_noise.hpp>

/// An inertial measurement unit's data sheet as channels of sensor_noise.hpp.
namespace gsp {

/// Accelerometer [m/s^2] and gyro [rad/s], each of three axes.
struct ImuNoise {
  ChannelNoise accelerometer = {}, gyro = {};  // of each axis
  // rows of what is added: y = x + matrix x. On the diagonal errors of scale, beside it of directions [rad]
  std::array<double, 9> accelerometer_matrix{}, gyro_matrix{};
  std::array<double, 9> g_sensitivity{};  // [rad/s per m/s^2] rows: what the gyro says of what the accelerometer feels
};

/// The deviation of a bounded bias whose Allan deviation is `instability` where it is greatest: what data sheets call bias instability.
inline double bias_of_instability(double instability) { return instability / 0.6173643; }

/// Six channels: accelerometer x, y, z, gyro x, y, z; `columns` of the options say where they stand. For make_sensor_noise.
inline SensorNoiseOptions imu_noise(ImuNoise const& imu, SensorNoiseOptions options = {}) {
  options.channels.assign(3, imu.accelerometer);
  options.channels.insert(options.channels.end(), 3, imu.gyro);
  std::vector<double> coupling(36, 0);
  bool any = false;
  auto const block = [&](int row, int column, std::array<double, 9> const& m) {
    for (int i = 0; i < 9; ++i) {
      coupling[6 * (row + i / 3) + column + i % 3] = m[i];
      any = any || m[i] != 0;
    }
  };
  block(0, 0, imu.accelerometer_matrix);
  block(3, 3, imu.gyro_matrix);
  block(3, 0, imu.g_sensitivity);
  options.coupling.clear();
  if (any || options.per_world) options.coupling = std::move(coupling);
  return options;
}

}  // namespace gsp
