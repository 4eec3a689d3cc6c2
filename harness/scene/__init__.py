"""What a scene is: geometry over time, camera, lights, and the effects that it calls for."""
