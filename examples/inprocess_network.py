"""A hundred drones in one process, without ROS: a third fail, the others repair the mesh."""

from drone_mesh.inprocess import Network

network = Network(seed=1)
network.add_fleet(gateways=1, routers=99, gridsize=10, spacing=6.0)
network.run_until(network.all_connected, within_s=30.0)
print(f"all connected {network.clock.now_s:.1f} s after the start")
for node in range(3, 100, 3):
    network.power(node, on=False)
network.run_for(10.0)
healed = network.run_until(lambda: network.all_connected(network.shortest_hops()), within_s=60.0)
print(f"all nodes with a path are connected: {healed}, {network.clock.now_s:.1f} s")
